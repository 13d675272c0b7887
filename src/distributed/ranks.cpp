#include "doppel/distributed/ranks.h"

#include <unistd.h>

#include <algorithm>
#include <future>
#include <thread>

#include "doppel/core/error.h"
#include "doppel/core/process.h"
#include "doppel/distributed/c10d_link.h"
#include "doppel/distributed/rank_watch.h"

namespace doppel {

namespace {

using Clock = std::chrono::steady_clock;

/// Of one exchange. Ranks that live may be late: rank 0 measures the validation loss and draws images.
constexpr std::chrono::minutes kExchangeLimit{60};
constexpr std::chrono::milliseconds kPoll{50};
/// Below this, a sum gathers the tensors of all ranks.
constexpr std::int64_t kShortBytes = 1 << 20;

std::string own_name(int rank) {
  return fmt::format("rank {} (process {} on {})", rank, static_cast<long>(getpid()), host_name());
}

std::string first_difference(const std::string& here, const std::string& there) {
  const auto line = [](const std::string& text, std::size_t at) {
    const std::size_t begin = at == 0 ? 0 : text.rfind('\n', at - 1) + 1;
    return text.substr(begin, text.find('\n', at) - begin);
  };
  std::size_t at = 0;
  while (at < here.size() && at < there.size() && here[at] == there[at]) ++at;
  return fmt::format("here `{}`, there `{}`", line(here, at), line(there, at));
}

}  // namespace

Ranks::Ranks() = default;

Ranks::Ranks(const RankOptions& options) : options_(options) {
  if (!several()) return;
  board_ = std::make_unique<NoteBoard>(options.host, options.port, is_first() && options.keeps_notes, options.attempt,
                                       options.join_limit);
  try {
    meet();
  } catch (const std::exception& e) {
    if (!watch_)
      board_->write("failed", e.what());
    else [[maybe_unused]]
      const auto* const board = board_.release();  // the thread that connects may still read it
    throw;
  }
}

Ranks::~Ranks() {
  if (!broken_) return;
  // Their threads wait in exchanges that do not end; the process ends with them.
  [[maybe_unused]] const auto* const exchanges = exchanges_.release();
  [[maybe_unused]] const auto* const background = background_.release();
}

/// The ranks agree on their number, learn each other's names, and connect.
void Ranks::meet() {
  const std::string mine = std::to_string(rank());
  const Clock::time_point end = Clock::now() + options_.join_limit;
  const auto await = [&](const std::string& note, const std::string& whose) {
    while (!board_->has(note)) {
      if (board_->has("failed")) fail("another rank could not begin: {}", board_->read("failed"));
      if (stop_requested()) fail("stopped while waiting for {}", whose);
      if (Clock::now() > end)
        fail("waited {} s for {} of {} at {}:{}, and it did not come; start all ranks, each with its own number",
             options_.join_limit.count() / 1000, whose, world(), options_.host, options_.port);
      std::this_thread::sleep_for(kPoll);
    }
    return board_->read(note);
  };
  if (is_first()) board_->write("world", std::to_string(world()));
  const std::string agreed = await("world", "rank 0");
  if (agreed != std::to_string(world()))
    fail<UsageError>("rank {} was started as one of {} ranks, rank 0 as one of {}; all must name the same number", mine,
                     world(), agreed);
  if (board_->add("claims/" + mine, 1) > 1)
    fail<UsageError>("two processes were started as rank {}; each needs its own number from 0 to {}", mine,
                     world() - 1);
  board_->write("name/" + mine, own_name(rank()));
  for (int i = 0; i < world(); ++i) names_.push_back(await(fmt::format("name/{}", i), fmt::format("rank {}", i)));
  watch_ = std::make_unique<RankWatch>(options_, names_);

  // Connecting waits for ranks that may have died meanwhile, so it has its own thread.
  const auto connected = std::make_shared<std::promise<void>>();
  std::future<void> future = connected->get_future();
  struct Both {
    std::unique_ptr<Exchanges> first, second;
  };
  const auto made = std::make_shared<Both>();
  std::thread([connected, made, this_board = board_.get(), options = options_] {
    try {
      made->first = std::make_unique<Exchanges>(*this_board, "exchanges", options.rank, options.world, kExchangeLimit);
      made->second =
          std::make_unique<Exchanges>(*this_board, "background", options.rank, options.world, kExchangeLimit);
      connected->set_value();
    } catch (...) {
      connected->set_exception(std::current_exception());
    }
  }).detach();
  wait_until([&](std::chrono::milliseconds limit) {
    if (future.wait_for(limit) != std::future_status::ready) return false;
    future.get();
    return true;
  });
  exchanges_ = std::move(made->first);
  background_ = std::move(made->second);
}

void Ranks::wait_until(const std::function<bool(std::chrono::milliseconds)>& ended) {
  while (true) {
    try {
      if (ended(watch_->interval())) return;
    } catch (const std::exception& e) {
      broken_ = true;
      fail("{}", watch_->explain_broken_connection(e.what()));
    }
    if (const auto verdict = watch_->verdict()) {
      broken_ = true;
      fail("{}", *verdict);
    }
  }
}

void Ranks::wait(Exchange& exchange) {
  wait_until([&](std::chrono::milliseconds limit) { return exchange.wait(limit); });
}

void Ranks::sum(const torch::Tensor& tensor) {
  if (!several() || tensor.numel() == 0) return;
  if (static_cast<std::int64_t>(tensor.nbytes()) * world() > kShortBytes) {
    Exchange exchange = exchanges_->sum(tensor);
    return wait(exchange);
  }
  // A short message costs its ways, not its bytes, and this needs half as many ways as a sum by pieces.
  const torch::NoGradGuard no_grad;
  std::vector<torch::Tensor> parts;
  for (int i = 0; i < world(); ++i) parts.push_back(torch::empty_like(tensor));
  Exchange exchange = exchanges_->gather(tensor, parts);
  wait(exchange);
  tensor.zero_();
  for (const torch::Tensor& part : parts) tensor.add_(part);
}

void Ranks::broadcast(const torch::Tensor& tensor) {
  if (!several() || tensor.numel() == 0) return;
  // As bytes, because Gloo does not know all types.
  const torch::Tensor bytes =
      torch::from_blob(tensor.data_ptr(), {static_cast<std::int64_t>(tensor.nbytes())}, torch::kUInt8);
  Exchange exchange = exchanges_->broadcast(bytes);
  wait(exchange);
}

std::string Ranks::broadcast(const std::string& text) {
  if (!several()) return text;
  const torch::Tensor size = torch::tensor({static_cast<std::int64_t>(text.size())}, torch::kInt64);
  broadcast(size);
  const torch::Tensor bytes = torch::zeros({size.item<std::int64_t>()}, torch::kUInt8);
  if (is_first()) std::copy(text.begin(), text.end(), bytes.data_ptr<std::uint8_t>());
  broadcast(bytes);
  const auto* begin = bytes.data_ptr<std::uint8_t>();
  return {begin, begin + bytes.numel()};
}

void Ranks::check_same(const std::string& what, const std::string& text) {
  const std::string there = broadcast(text);
  if (text != there) fail("{} of rank {} is not that of rank 0: {}", what, rank(), first_difference(text, there));
}

std::function<void()> Ranks::begin_sum(const torch::Tensor& tensor) {
  if (!several() || tensor.numel() == 0) return [] {};
  const auto exchange = std::make_shared<Exchange>(background_->sum(tensor));
  return [this, exchange] { wait(*exchange); };
}

void Ranks::leave(const std::string& reason) {
  if (!watch_) return;
  broken_ = true;
  watch_->tell(fmt::format("{} has ended: {}", names_.at(static_cast<std::size_t>(rank())), reason));
}

}  // namespace doppel
