#include "doppel/view/view_sender.h"

#include <httplib.h>

#include <condition_variable>
#include <mutex>
#include <optional>
#include <regex>
#include <thread>

#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel {
namespace {

constexpr int kSeconds = 2;  // to connect, and for an answer

struct Address {
  int port = 0;
  std::string token;
};

Address address_of(const std::string& text) {
  static const std::regex form(R"(http://(127\.0\.0\.1|localhost):([0-9]{1,5})/?\?token=([0-9a-f]+))");
  std::smatch found;
  if (!std::regex_match(text, found, form))
    fail<UsageError>(
        "sending poses: '{}' is not the address of a viewer on this computer; it must be the one that `doppel view` "
        "prints, http://127.0.0.1:PORT/?token=...",
        text);
  const int port = std::stoi(found[2]);
  if (port < 1 || port > 65535) fail<UsageError>("sending poses: {} is not a port; ports are 1..65535", port);
  return {port, found[3]};
}

}  // namespace

struct ViewSender::State {
  struct Pose {
    std::vector<float> dofs;
    bool tracked;
  };

  explicit State(const Address& address) : token(address.token), client("127.0.0.1", address.port) {
    client.set_keep_alive(true);
    client.set_tcp_nodelay(true);
    client.set_connection_timeout(kSeconds);
    client.set_read_timeout(kSeconds);
    client.set_write_timeout(kSeconds);
  }

  /// Sends what is newest until the sender ends.
  void run() {
    std::unique_lock lock(mutex);
    for (;;) {
      changed.wait(lock, [&] { return ending || newest; });
      if (ending) return;
      const Pose pose = *std::exchange(newest, std::nullopt);
      lock.unlock();
      post(pose);
      lock.lock();
    }
  }

  void post(const Pose& pose) {
    const auto answer = client.Post("/api/live?token=" + token + "&tracked=" + (pose.tracked ? "1" : "0"),
                                    reinterpret_cast<const char*>(pose.dofs.data()), pose.dofs.size() * sizeof(float),
                                    "application/octet-stream");
    const std::string problem = !answer                 ? "nobody answers; is `doppel view` running?"
                                : answer->status >= 400 ? answer->body
                                                        : "";
    if (!problem.empty() && problem != last_problem) log::warn("sending poses to the viewer: {}", problem);
    last_problem = problem;
  }

  const std::string token;
  httplib::Client client;
  std::string last_problem;
  std::mutex mutex;  ///< of the three below
  std::condition_variable changed;
  std::optional<Pose> newest;
  bool ending = false;
  std::thread thread;
};

ViewSender::ViewSender(const std::string& address) : state_(std::make_unique<State>(address_of(address))) {
  state_->thread = std::thread([state = state_.get()] { state->run(); });
}

ViewSender::~ViewSender() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->ending = true;
  }
  state_->changed.notify_one();
  state_->client.stop();
  state_->thread.join();
}

void ViewSender::send(const std::vector<double>& dofs, bool tracked) {
  {
    const std::lock_guard lock(state_->mutex);
    state_->newest = State::Pose{{dofs.begin(), dofs.end()}, tracked};
  }
  state_->changed.notify_one();
}

}  // namespace doppel
