#include "doppel/view/view_connections.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <thread>

#include "doppel/core/error.h"

namespace doppel {
namespace {

using Clock = std::chrono::steady_clock;
using Duration = std::chrono::duration<double>;

constexpr std::size_t kWorkers = 32, kMaxConnections = 256, kMaxHeadBytes = 32 << 10, kBytesAtOnce = 16 << 10;
constexpr std::chrono::seconds kPatience{5};
constexpr double kMinBytesPerSecond = 16 << 10;
constexpr std::chrono::milliseconds kLookForStop{100};
constexpr std::string_view kEndOfHead = "\r\n\r\n";

/// @return whether `bytes` contain a whole head; its end is looked for from `from` on
bool has_head(const std::string& bytes, std::size_t from) { return bytes.find(kEndOfHead, from) != std::string::npos; }

/// How many bytes the body of a request has; none: the request does not say so.
std::optional<std::size_t> body_bytes(const httplib::Request& request) {
  if (request.has_header("Transfer-Encoding")) return {};
  if (!request.has_header("Content-Length")) return 0;
  const std::string text = request.get_header_value("Content-Length");
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return value;
}

}  // namespace

struct ViewConnections::Connection {
  explicit Connection(int given) : socket(given) {}
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection() { ::close(socket); }

  const int socket;
  std::string unread;  ///< what has come of the next request
  bool ended = false;  ///< no request follows, and what still comes is thrown away
  Clock::time_point closes;
};

namespace {

/// What the library reads from a client and writes to it. The client may let the worker wait for five seconds in all;
/// every 16 KB that pass give it a second more, up to five again.
class ClientStream : public httplib::Stream {
 public:
  /// @param unread bytes that were received before; what is read of them is removed
  ClientStream(int socket, std::string& unread, const std::atomic<bool>& stopping)
      : socket_(socket), unread_(unread), stopping_(stopping) {}
  ~ClientStream() override { unread_.erase(0, used_); }
  ClientStream(const ClientStream&) = delete;
  ClientStream& operator=(const ClientStream&) = delete;

  std::size_t bytes_read() const { return bytes_read_; }

  bool is_readable() const override { return used_ < unread_.size() || is_ready(POLLIN, {}); }
  bool is_writable() const override { return is_ready(POLLOUT, {}); }
  socket_t socket() const override { return socket_; }
  void get_remote_ip_and_port(std::string& ip, int& port) const override { loopback(ip, port); }
  void get_local_ip_and_port(std::string& ip, int& port) const override { loopback(ip, port); }

  ssize_t read(char* bytes, std::size_t size) override {
    ssize_t count = static_cast<ssize_t>(unread_.copy(bytes, size, used_));
    if (count > 0) {
      used_ += static_cast<std::size_t>(count);
    } else {
      do {
        if (!wait(POLLIN)) return -1;
        count = ::recv(socket_, bytes, size, 0);
      } while (count < 0 && errno == EAGAIN);
    }
    if (count > 0) bytes_read_ += static_cast<std::size_t>(count);
    refill(count);
    return count;
  }

  /// Writes all bytes. The library takes a part for a failure.
  ssize_t write(const char* bytes, std::size_t size) override {
    for (std::size_t done = 0; done < size;) {
      if (!wait(POLLOUT)) return -1;
      const ssize_t count = ::send(socket_, bytes + done, std::min(size - done, kBytesAtOnce), MSG_NOSIGNAL);
      if (count < 0 && errno != EAGAIN) return -1;
      if (count > 0) done += static_cast<std::size_t>(count);
      refill(count);
    }
    return static_cast<ssize_t>(size);
  }

 private:
  static void loopback(std::string& ip, int& port) {
    ip = "127.0.0.1";
    port = 0;
  }

  bool is_ready(short event, std::chrono::milliseconds within) const {
    pollfd polled = {socket_, event, 0};
    return ::poll(&polled, 1, static_cast<int>(within.count())) > 0;
  }

  /// Waits for the client. @return false: its time is over, or the server stops
  bool wait(short event) {
    while (may_wait_ > Duration::zero() && !stopping_) {
      const Clock::time_point start = Clock::now();
      const bool ready = is_ready(event, kLookForStop);
      may_wait_ -= Clock::now() - start;
      if (ready) return true;
    }
    return false;
  }

  void refill(ssize_t count) {
    if (count > 0) may_wait_ = std::min<Duration>(kPatience, may_wait_ + Duration(count / kMinBytesPerSecond));
  }

  const int socket_;
  std::string& unread_;
  const std::atomic<bool>& stopping_;
  std::size_t used_ = 0, bytes_read_ = 0;
  Duration may_wait_ = kPatience;
};

}  // namespace

ViewConnections::ViewConnections() : wake_event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (wake_event_ < 0)
    fail("viewing: the system has no file descriptor left; close other programs or raise `ulimit -n`");
  set_keep_alive_timeout(kPatience.count());  // for the header of answers
}

ViewConnections::~ViewConnections() {
  if (svr_sock_ != INVALID_SOCKET) ::close(svr_sock_);
  ::close(wake_event_);
}

std::optional<int> ViewConnections::bind(int port) {
  // The library's default lets a second program share the port.
  set_socket_options([](socket_t socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  });
  const int bound = port == 0 ? bind_to_any_port("127.0.0.1") : bind_to_port("127.0.0.1", port) ? port : -1;
  if (bound <= 0) return {};
  ::listen(svr_sock_, SOMAXCONN);  // the library lets five wait
  return bound;
}

void ViewConnections::serve() {
  workers_ = std::make_unique<httplib::ThreadPool>(kWorkers);
  while (!stopping_) step();
  workers_->shutdown();
  waiting_.clear();
  returned_.clear();
}

void ViewConnections::stop() {
  stopping_ = true;
  wake();
}

void ViewConnections::wake() const { ::eventfd_write(wake_event_, 1); }

/// Waits until something comes, and sees to that.
void ViewConnections::step() {
  take_back();
  const bool takes_more = being_answered_ < kMaxConnections;
  std::vector<pollfd> polled = {{wake_event_, POLLIN, 0}, {svr_sock_, static_cast<short>(takes_more ? POLLIN : 0), 0}};
  for (const ConnectionPointer& connection : waiting_) polled.push_back({connection->socket, POLLIN, 0});
  if (::poll(polled.data(), polled.size(), milliseconds_to_wait()) < 0) {
    if (errno != EINTR) std::this_thread::sleep_for(kLookForStop);  // a low limit of open files: do not spin
    return;
  }
  eventfd_t ignored = 0;
  if (polled[0].revents != 0) ::eventfd_read(wake_event_, &ignored);
  std::size_t at = 2;
  waiting_.remove_if(
      [&](const ConnectionPointer& connection) { return polled[at++].revents != 0 && !goes_on_waiting(connection); });
  close_late();
  if (polled[1].revents != 0) accept_one();
}

/// @return until the first connection must be closed; -1: none waits
int ViewConnections::milliseconds_to_wait() const {
  if (waiting_.empty()) return -1;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(waiting_.front()->closes - Clock::now());
  return static_cast<int>(std::max<std::int64_t>(0, left.count()));
}

void ViewConnections::take_back() {
  std::vector<ConnectionPointer> back;
  {
    const std::lock_guard lock(returning_);
    back.swap(returned_);
  }
  being_answered_ -= back.size();
  for (ConnectionPointer& connection : back)
    if (connection) {
      const bool next_is_there = !connection->ended && has_head(connection->unread, 0);
      next_is_there ? hand_over(connection) : let_wait(connection);
    }
}

void ViewConnections::let_wait(const ConnectionPointer& connection) {
  connection->closes = Clock::now() + kPatience;
  waiting_.push_back(connection);
}

/// Lets a worker answer the request whose head is there.
void ViewConnections::hand_over(const ConnectionPointer& connection) {
  ++being_answered_;
  workers_->enqueue([this, connection] {
    const bool stays = answer(*connection);
    {
      const std::lock_guard lock(returning_);
      returned_.push_back(stays ? connection : nullptr);
    }
    wake();
  });
}

/// Takes what has come. @return whether the connection waits for more
bool ViewConnections::goes_on_waiting(const ConnectionPointer& connection) {
  std::array<char, kBytesAtOnce> bytes;
  const ssize_t count = ::recv(connection->socket, bytes.data(), bytes.size(), 0);
  if (count < 0) return errno == EAGAIN || errno == EINTR;
  if (count == 0) return false;
  if (connection->ended) return true;
  std::string& unread = connection->unread;
  const std::size_t before = unread.size();
  unread.append(bytes.data(), static_cast<std::size_t>(count));
  if (!has_head(unread, before - std::min(before, kEndOfHead.size() - 1))) return unread.size() < kMaxHeadBytes;
  hand_over(connection);
  return false;
}

void ViewConnections::accept_one() {
  if (waiting_.size() + being_answered_ >= kMaxConnections) {
    if (waiting_.empty()) return;
    waiting_.pop_front();
  }
  const int socket = ::accept4(svr_sock_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (socket < 0) {
    // Without a free file descriptor the next one waits in the system; a pause keeps this loop from spinning.
    if (errno == EMFILE || errno == ENFILE) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return;
  }
  const int yes = 1;  // head and body of an answer are two writes; the second must not wait for the client
  ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
  let_wait(std::make_shared<Connection>(socket));
}

void ViewConnections::close_late() {
  while (!waiting_.empty() && waiting_.front()->closes <= Clock::now()) waiting_.pop_front();
}

/// Answers one request, in a worker. @return whether the connection stays open
bool ViewConnections::answer(Connection& connection) {
  std::optional<std::size_t> wanted;  // bytes of head and body, where the library has understood the head
  ClientStream stream(connection.socket, connection.unread, stopping_);
  const auto note_size = [&](httplib::Request& request) {
    // Of a form, which curl says that it sends, the library takes 8 KB alone.
    if (request.get_header_value("Content-Type").starts_with("application/x-www-form-urlencoded"))
      request.headers.erase("Content-Type");
    if (const auto body = body_bytes(request)) wanted = stream.bytes_read() + *body;
  };
  bool closed = false;
  // Version 0.18 of the library wants the addresses, version 0.11 does not.
  const auto process = [&](auto& server) {
    if constexpr (requires { server.process_request(stream, false, closed, note_size); })
      return server.process_request(stream, false, closed, note_size);
    else
      return server.process_request(stream, "127.0.0.1", 0, "127.0.0.1", 0, false, closed, note_size);
  };
  if (!process(*this)) return false;
  connection.ended = wanted != stream.bytes_read();
  // Closing now, while the client still sends, would throw away the answer.
  if (connection.ended) ::shutdown(connection.socket, SHUT_WR);
  return connection.ended || !closed;
}

}  // namespace doppel
