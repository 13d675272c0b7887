#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "doppel/distributed/rank_options.h"

namespace doppel {

/// Watches in a thread of its own whether the other ranks live, and carries the reason when one of them ends. A rank
/// that computes or writes for long lives; one that was killed, stopped, or cut off does not.
class RankWatch {
 public:
  /// @param names of all ranks, for messages
  RankWatch(const RankOptions& options, std::vector<std::string> names);
  ~RankWatch();
  RankWatch(const RankWatch&) = delete;
  RankWatch& operator=(const RankWatch&) = delete;

  /// How often ranks give a sign of life.
  std::chrono::milliseconds interval() const;
  /// A sentence that names the rank that ended or does not answer; nothing while all live.
  std::optional<std::string> verdict();
  /// Waits for the verdict after a connection broke. Fewer missing signs of life are then enough.
  std::string explain_broken_connection(const std::string& what_broke);
  /// Tells the other ranks why this one ends, and waits a moment until they know.
  void tell(const std::string& reason);

 private:
  struct State;
  std::shared_ptr<State> state_;  ///< shared with the thread, which may outlive this object when a connection hangs
};

}  // namespace doppel
