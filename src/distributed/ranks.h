#pragma once

#include <torch/types.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "doppel/distributed/batch_share.h"
#include "doppel/distributed/rank_options.h"

namespace doppel {

class Exchange;
class Exchanges;
class NoteBoard;
class RankWatch;

/// The processes that train together, seen from one of them. A single rank needs no network, and every function below
/// then does nothing. All ranks must call the functions in the same order. When a rank dies, every function that waits
/// throws an Error that names it, within `RankOptions::dead_after` and a few seconds.
class Ranks {
 public:
  /// A single rank.
  Ranks();
  /// Joins the other ranks. @throws UsageError or Error that says what keeps them apart: a port in use, a rank that
  /// does not come or comes twice, another number of ranks
  explicit Ranks(const RankOptions& options);
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int rank() const { return options_.rank; }
  int world() const { return options_.world; }
  bool several() const { return options_.world > 1; }
  bool is_first() const { return options_.rank == 0; }
  /// This rank's rows of a batch.
  BatchShare share(std::int64_t whole) const { return BatchShare::of(rank(), world(), whole); }

  /// Replaces a contiguous tensor by the sum over the ranks, which has the same bits on all ranks.
  void sum(const torch::Tensor& tensor);
  /// Replaces a contiguous tensor by that of rank 0.
  void broadcast(const torch::Tensor& tensor);
  /// The text of rank 0.
  std::string broadcast(const std::string& text);
  /// @throws Error on a rank whose text is not that of rank 0 @param what the message, for instance "the configuration"
  void check_same(const std::string& what, const std::string& text);

  /// Begins a sum that goes on while this rank computes. Sums that were begun end in this order, and they do not
  /// disturb the functions above. @return a function that waits for the end
  std::function<void()> begin_sum(const torch::Tensor& tensor);

  /// Tells the other ranks why this one ends.
  void leave(const std::string& reason);

 private:
  void meet();
  void wait(Exchange& exchange);
  void wait_until(const std::function<bool(std::chrono::milliseconds)>& ended);

  RankOptions options_;
  std::vector<std::string> names_;  ///< of all ranks: "rank 1 (process 17 on anna)"
  std::unique_ptr<NoteBoard> board_;
  std::unique_ptr<RankWatch> watch_;
  std::unique_ptr<Exchanges> exchanges_, background_;
  bool broken_ = false;
};

}  // namespace doppel
