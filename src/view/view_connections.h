#pragma once

#include <httplib.h>

#include <atomic>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

namespace doppel {

/// A web server whose connections take no worker while they wait. One thread reads the heads of all requests. A request
/// whose head is whole goes to one of 32 workers, which reads its body, answers, and gives the connection back.
///
/// - At most 256 connections are open. One more closes the connection that has waited longest for its request.
/// - The head of a request has five seconds and 32 KB; the connection is closed otherwise. So is one that stands still
///   for five seconds after an answer.
/// - A worker waits for a slow client, who sends a body or takes an answer, five seconds in all, and a second more for
///   each 16 KB that pass. A client that stands still for five seconds ends the connection.
/// - When an answer leaves a part of the body unread, the connection ends: the rest is no request.
class ViewConnections : private httplib::Server {
 public:
  ViewConnections();
  ViewConnections(const ViewConnections&) = delete;
  ViewConnections& operator=(const ViewConnections&) = delete;
  ~ViewConnections() override;

  // What the library's server does.
  using httplib::Server::Get;
  using httplib::Server::HandlerResponse;
  using httplib::Server::Post;
  using httplib::Server::set_default_headers;
  using httplib::Server::set_payload_max_length;
  using httplib::Server::set_pre_routing_handler;

  /// Binds a port of the loopback interface; 0: any free one. @return the port; none: it is taken or not allowed
  std::optional<int> bind(int port);
  /// Answers the requests of the bound port until `stop`, which may come first. Called once.
  void serve();
  /// From any thread. Connections that wait are closed, handlers that run end.
  void stop();

 private:
  struct Connection;
  using ConnectionPointer = std::shared_ptr<Connection>;

  void step();
  int milliseconds_to_wait() const;
  void take_back();
  void let_wait(const ConnectionPointer& connection);
  void hand_over(const ConnectionPointer& connection);
  bool goes_on_waiting(const ConnectionPointer& connection);
  void accept_one();
  void close_late();
  bool answer(Connection& connection);
  void wake() const;

  const int wake_event_;
  std::atomic<bool> stopping_ = false;
  std::list<ConnectionPointer> waiting_;  ///< the longest first
  std::size_t being_answered_ = 0;
  std::mutex returning_;                     ///< of `returned_`
  std::vector<ConnectionPointer> returned_;  ///< answered; null: closed
  std::unique_ptr<httplib::ThreadPool> workers_;
};

}  // namespace doppel
