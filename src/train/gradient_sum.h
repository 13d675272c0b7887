#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <cstdint>
#include <functional>
#include <vector>

#include "doppel/distributed/ranks.h"

namespace doppel {

/// Sums the gradients of a module over the ranks while the backward pass goes on. Parameters are packed into buckets,
/// the last parameter first, because the backward pass reaches it first. A bucket is sent as soon as it is full. The
/// order of the buckets is fixed, so that all ranks send them in the same order.
///
/// A parameter that has a gradient on some ranks only counts as 0 on the others. One without a gradient on any rank
/// keeps none.
class GradientSum {
 public:
  /// @param ranks null: nothing is summed @param bucket_bytes after which a bucket is sent
  GradientSum(torch::nn::Module& module, Ranks* ranks, std::int64_t bucket_bytes = 1 << 22);
  ~GradientSum();
  GradientSum(const GradientSum&) = delete;
  GradientSum& operator=(const GradientSum&) = delete;

  /// Sends what has not been sent, waits, and replaces the gradients by their sums. Call it once after each backward
  /// pass; a step without one counts as zero gradients.
  void finish();

 private:
  struct Bucket {
    std::vector<torch::Tensor> parameters;
    std::vector<std::int64_t> offsets;  ///< of each parameter in `values`
    torch::Tensor values;               ///< all gradients, then for each parameter 1 or 0: whether it has one
    std::size_t ready = 0;              ///< parameters whose gradient is complete
    std::function<void()> wait;         ///< set while the bucket is under way
  };
  void note_ready(std::size_t bucket);
  void send(Bucket& bucket);
  static void unpack(Bucket& bucket);

  Ranks* ranks_;
  std::vector<Bucket> buckets_;
  std::size_t sent_ = 0;  ///< buckets 0 .. sent_ - 1 are under way
  std::vector<std::function<void()>> remove_hooks_;
};

}  // namespace doppel
