// The macro with which LibTorch was built. Its headers are empty without it, and not every build passes it on.
#ifndef USE_C10D_GLOO
#define USE_C10D_GLOO
#endif
#include "doppel/distributed/c10d_link.h"

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <torch/csrc/distributed/c10d/PrefixStore.hpp>
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>
#include <torch/csrc/distributed/c10d/TCPStore.hpp>

#include "doppel/core/error.h"

namespace doppel {

namespace {

/// The address under which other ranks reach this machine: that of the way to the keeper of the notes. The name of the
/// machine often stands for a loopback address.
std::string own_address(const std::string& host, int port) {
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_DGRAM;
  if (getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) return host;
  std::string address = host;
  const int channel = socket(found->ai_family, SOCK_DGRAM, 0);
  sockaddr_storage own{};
  socklen_t size = sizeof(own);
  char text[NI_MAXHOST];
  // Connecting a datagram socket sends nothing; it chooses the interface.
  if (channel >= 0 && connect(channel, found->ai_addr, found->ai_addrlen) == 0 &&
      getsockname(channel, reinterpret_cast<sockaddr*>(&own), &size) == 0 &&
      getnameinfo(reinterpret_cast<sockaddr*>(&own), size, text, sizeof(text), nullptr, 0, NI_NUMERICHOST) == 0)
    address = text;
  if (channel >= 0) close(channel);
  freeaddrinfo(found);
  return address;
}

/// LibTorch 2 takes libuv by default, and Debian builds LibTorch without libuv.
void without_libuv(auto& options) {
  if constexpr (requires { options.useLibUV; }) options.useLibUV = false;
}

/// Without the backtrace that LibTorch adds.
std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

c10::intrusive_ptr<c10d::Store> open_store(const std::string& host, int port, bool keeper,
                                           std::chrono::milliseconds limit) {
  c10d::TCPStoreOptions options;
  options.port = static_cast<std::uint16_t>(port);
  options.isServer = keeper;
  options.waitWorkers = false;
  options.timeout = limit;
  without_libuv(options);
  try {
    return c10::make_intrusive<c10d::TCPStore>(host, options);
  } catch (const std::exception& e) {
    const std::string text = first_line(e.what());
    if (keeper)
      fail("rank 0 cannot open port {}: {}. Another program, or another training, may have it; choose another port",
           port,
           text.find("EADDRINUSE") != std::string::npos || text.find("already in use") != std::string::npos
               ? "it is in use"
               : text);
    fail(
        "rank 0 did not answer at {}:{} within {} s. Is it started, is this its address, and does a firewall let the "
        "port through?",
        host, port, limit.count() / 1000);
  }
}

}  // namespace

struct NoteBoard::Impl {
  std::string host;
  int port;
  c10::intrusive_ptr<c10d::Store> store;
};

NoteBoard::NoteBoard(const std::string& host, int port, bool keeper, const std::string& attempt,
                     std::chrono::milliseconds limit)
    : impl_(new Impl{
          host, port,
          c10::make_intrusive<c10d::PrefixStore>("doppel/" + attempt, open_store(host, port, keeper, limit))}) {}

NoteBoard::~NoteBoard() = default;

void NoteBoard::write(const std::string& name, const std::string& text) {
  impl_->store->set(name, std::vector<std::uint8_t>(text.begin(), text.end()));
}

bool NoteBoard::has(const std::string& name) { return impl_->store->check({name}); }

std::string NoteBoard::read(const std::string& name) {
  const std::vector<std::uint8_t> bytes = impl_->store->get(name);
  return {bytes.begin(), bytes.end()};
}

std::int64_t NoteBoard::add(const std::string& name, std::int64_t amount) { return impl_->store->add(name, amount); }

struct Exchange::Impl {
  c10::intrusive_ptr<c10d::Work> work;
  std::vector<torch::Tensor> tensors{};  ///< these and `parts` must live until the end
  std::vector<std::vector<torch::Tensor>> parts{};
};

Exchange::Exchange(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Exchange::Exchange(Exchange&&) noexcept = default;
Exchange::~Exchange() = default;

bool Exchange::wait(std::chrono::milliseconds limit) {
  try {
    return impl_->work->wait(limit);
  } catch (const std::exception& e) {
    if (!impl_->work->isCompleted()) return false;  // the limit is over
    throw Error(first_line(e.what()));
  }
}

struct Exchanges::Impl {
  c10::intrusive_ptr<c10d::ProcessGroupGloo> group;
};

Exchanges::Exchanges(NoteBoard& board, const std::string& name, int rank, int world, std::chrono::milliseconds limit) {
  const auto options = c10d::ProcessGroupGloo::Options::create(limit);
  const char* interface = std::getenv("GLOO_SOCKET_IFNAME");
  options->devices.push_back(interface && *interface ? c10d::ProcessGroupGloo::createDeviceForInterface(interface)
                                                     : c10d::ProcessGroupGloo::createDeviceForHostname(
                                                           own_address(board.impl_->host, board.impl_->port)));
  options->threads = 1;  // one exchange at a time: two would share one wire
  const auto store = c10::make_intrusive<c10d::PrefixStore>(name, board.impl_->store);
  impl_ = std::make_unique<Impl>(Impl{c10::make_intrusive<c10d::ProcessGroupGloo>(store, rank, world, options)});
}

Exchanges::~Exchanges() = default;

Exchange Exchanges::sum(torch::Tensor tensor) {
  auto exchange = std::make_unique<Exchange::Impl>();
  exchange->tensors = {std::move(tensor)};
  exchange->work = impl_->group->allreduce(exchange->tensors);
  return Exchange(std::move(exchange));
}

Exchange Exchanges::gather(torch::Tensor tensor, std::vector<torch::Tensor> parts) {
  auto exchange = std::make_unique<Exchange::Impl>();
  exchange->tensors = {std::move(tensor)};
  exchange->parts = {std::move(parts)};
  exchange->work = impl_->group->allgather(exchange->parts, exchange->tensors);
  return Exchange(std::move(exchange));
}

Exchange Exchanges::broadcast(torch::Tensor tensor) {
  auto exchange = std::make_unique<Exchange::Impl>();
  exchange->tensors = {std::move(tensor)};
  exchange->work = impl_->group->broadcast(exchange->tensors);
  return Exchange(std::move(exchange));
}

}  // namespace doppel
