#include "doppel/view/view_connections.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace doppel::view_connections_test {
namespace {

using namespace std::chrono_literals;

constexpr const char* kRequest = "GET / HTTP/1.1\r\nHost: x\r\n\r\n";

/// A client that sends what it likes, when it likes.
class Client {
 public:
  explicit Client(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    const timeval patience = {20, 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  }
  Client(Client&& other) noexcept : socket_(std::exchange(other.socket_, -1)), connected_(other.connected_) {}
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client() {
    if (socket_ >= 0) ::close(socket_);
  }

  bool connected() const { return connected_; }
  void send(std::string_view bytes) const { ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT); }
  /// Reads until the server ends the connection, or until `enough` comes.
  std::string answer(const std::string& enough = {}) const {
    std::string text;
    char bytes[4096];
    for (ssize_t count = 0; (count = ::recv(socket_, bytes, sizeof(bytes), 0)) > 0;) {
      text.append(bytes, static_cast<std::size_t>(count));
      if (!enough.empty() && text.find(enough) != std::string::npos) break;
    }
    return text;
  }
  /// Whether the server has not ended the connection.
  bool is_open() const {
    char byte = 0;
    const ssize_t count = ::recv(socket_, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
    return count > 0 || (count < 0 && (errno == EAGAIN || errno == EINTR));
  }

 private:
  int socket_ = -1;
  bool connected_ = false;
};

std::size_t count_of(const std::string& text, std::string_view part) {
  std::size_t count = 0;
  for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; at += part.size()) ++count;
  return count;
}

/// A server in a thread of its own. It says `here` at `/`, how long a body is, and much at `/much`; `/no` is refused.
class ViewConnectionsTest : public testing::Test {
 protected:
  ViewConnectionsTest() {
    server_.Get("/", [](const auto&, auto& response) { response.set_content("here", "text/plain"); });
    server_.Get("/much",
                [](const auto&, auto& response) { response.set_content(std::string(6 << 20, 'x'), "text/plain"); });
    server_.Post("/", [](const auto& request, auto& response) {
      response.set_content("took " + std::to_string(request.body.size()), "text/plain");
    });
    server_.set_pre_routing_handler([](const auto& request, auto& response) {
      if (request.path != "/no") return ViewConnections::HandlerResponse::Unhandled;
      response.status = 403;
      response.set_content("refused", "text/plain");
      return ViewConnections::HandlerResponse::Handled;
    });
    port_ = server_.bind(0).value();
    thread_ = std::thread([this] { server_.serve(); });
  }
  ~ViewConnectionsTest() override {
    server_.stop();
    thread_.join();
  }

  /// Clients that send `text` and no more.
  std::vector<Client> clients(int count, const std::string& text) const {
    std::vector<Client> result;
    for (int i = 0; i < count; ++i) {
      result.emplace_back(port_);
      EXPECT_TRUE(result.back().connected());
      result.back().send(text);
    }
    return result;
  }
  /// @return whether a request is answered
  bool answers() const {
    const Client client(port_);
    client.send(kRequest);
    return client.answer("here").find("200 OK") != std::string::npos;
  }

  ViewConnections server_;
  std::thread thread_;
  int port_ = 0;
};

TEST_F(ViewConnectionsTest, AnswersWhileTwoHundredConnectionsSendNoRequest) {
  for (const char* begun : {"", "GET / HTTP/1.1\r\n"}) {
    const std::vector<Client> idle = clients(200, begun);
    EXPECT_TRUE(answers());
    EXPECT_TRUE(idle.back().is_open()) << "the answer came after they were closed";
  }
}

TEST_F(ViewConnectionsTest, OneConnectionTooManyClosesTheOneThatWaitedLongest) {
  const std::vector<Client> idle = clients(400, "GET / HTTP/1.1\r\n");
  EXPECT_TRUE(answers());
  EXPECT_TRUE(idle.back().is_open());
  EXPECT_FALSE(idle.front().is_open());
}

/// A byte now and then does not lengthen the time for a request's head.
TEST_F(ViewConnectionsTest, ClosesConnectionsWhoseRequestComesByteByByte) {
  const std::vector<Client> slow = clients(64, "GET / HTTP/1.1\r\nLong: ");
  std::atomic<bool> ending = false;
  std::thread dripping([&] {
    for (; !ending; std::this_thread::sleep_for(100ms))
      for (const Client& client : slow) client.send("x");
  });
  EXPECT_TRUE(answers());
  EXPECT_TRUE(slow.back().is_open()) << "the answer came after they were closed";
  const auto closed = [](const Client& client) { return !client.is_open(); };
  for (int i = 0; i < 100 && !std::all_of(slow.begin(), slow.end(), closed); ++i) std::this_thread::sleep_for(100ms);
  EXPECT_TRUE(std::all_of(slow.begin(), slow.end(), closed));
  ending = true;
  dripping.join();
}

/// More clients than workers send their body byte by byte. Each has five seconds of a worker.
TEST_F(ViewConnectionsTest, WorkersLeaveClientsThatSendSlowly) {
  const std::vector<Client> slow = clients(40, "POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 100000\r\n\r\n");
  std::atomic<bool> ending = false;
  std::thread dripping([&] {
    for (; !ending; std::this_thread::sleep_for(30ms))
      for (const Client& client : slow) client.send("x");
  });
  EXPECT_TRUE(answers());
  ending = true;
  dripping.join();
}

TEST_F(ViewConnectionsTest, WorkersLeaveClientsThatTakeNoAnswer) {
  const std::vector<Client> stopped = clients(40, "GET /much HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_TRUE(answers());
}

TEST_F(ViewConnectionsTest, AnswersAllRequestsOfOneConnection) {
  const Client client(port_);
  const std::string post = "POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 3\r\n\r\nabc";
  client.send(kRequest + post + kRequest + post.substr(0, post.size() - 1));
  const std::string first = client.answer("took 3");
  client.send("c" + std::string("GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"));
  const std::string all = first + client.answer();
  EXPECT_EQ(count_of(all, "200 OK"), 5) << all;
  EXPECT_EQ(count_of(all, "took 3"), 2) << all;
}

/// Otherwise a page of another site could put a request of its own into the body of one that is refused.
TEST_F(ViewConnectionsTest, TakesNoUnreadBodyForARequest) {
  const std::string hidden = kRequest, length = std::to_string(hidden.size());
  const std::string chunked = "Transfer-Encoding: chunked\r\n\r\n", sized = "Content-Length: " + length + "\r\n\r\n";
  for (const std::string& rest : {sized, chunked, "Content-Length: +" + length + "\r\n\r\n"}) {
    const Client client(port_);
    client.send("POST /no HTTP/1.1\r\nHost: x\r\n" + rest);
    const std::string refusal = client.answer("refused");
    client.send(hidden);
    const std::string answer = refusal + client.answer();
    EXPECT_EQ(count_of(answer, "HTTP/1.1 "), 1) << rest << answer;
    EXPECT_NE(answer.find("refused"), std::string::npos) << rest << answer;
  }
}

TEST_F(ViewConnectionsTest, RefusesAnEndlessHead) {
  const Client client(port_);
  client.send("GET / HTTP/1.1\r\n");
  for (int i = 0; i < 64 && client.is_open(); ++i) {
    client.send("Long: " + std::string(1 << 10, 'x') + "\r\n");
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_FALSE(client.is_open());
  EXPECT_TRUE(answers());
}

TEST(ViewConnections, StopsBeforeItServes) {
  ViewConnections server;
  ASSERT_TRUE(server.bind(0));
  server.stop();
  server.serve();
}

}  // namespace
}  // namespace doppel::view_connections_test
