#pragma once

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <exception>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "doppel/distributed/ranks.h"

namespace doppel::support {

/// A port of the loopback interface that was free a moment ago.
inline int free_port() {
  const int listener = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  if (bind(listener, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size) != 0)
    throw std::runtime_error("no free port");
  close(listener);
  return ntohs(address.sin_port);
}

/// Options for a test: ranks on the loopback interface that notice a death soon.
inline RankOptions test_rank(int rank, int world, int port) {
  RankOptions options;
  options.rank = rank;
  options.world = world;
  options.host = "127.0.0.1";
  options.port = port;
  options.join_limit = std::chrono::seconds(20);
  options.dead_after = std::chrono::seconds(15);
  return options;
}

/// Calls `work` once for each rank, each in its own thread. @return the message of each rank's error; empty: none
inline std::vector<std::string> on_ranks(int world, const std::function<void(Ranks&)>& work) {
  const int port = free_port();
  std::vector<std::string> errors(static_cast<std::size_t>(world));
  std::vector<std::thread> threads;
  for (int rank = 0; rank < world; ++rank)
    threads.emplace_back([&, rank] {
      try {
        Ranks ranks(test_rank(rank, world, port));
        try {
          work(ranks);
        } catch (const std::exception& e) {
          ranks.leave(e.what());
          throw;
        }
      } catch (const std::exception& e) {
        errors[static_cast<std::size_t>(rank)] = e.what();
      }
    });
  for (std::thread& thread : threads) thread.join();
  return errors;
}

}  // namespace doppel::support
