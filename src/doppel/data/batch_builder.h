#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "doppel/data/batch.h"
#include "doppel/data/dataset.h"
#include "doppel/data/sampling.h"

namespace doppel {

/// Keeps silhouettes in memory up to a budget: what came first stays, since every epoch visits everything anyway.
/// Thread-safe. Never changes what a caller gets.
class SilhouetteCache {
 public:
  explicit SilhouetteCache(std::size_t max_bytes) : max_bytes_(max_bytes) {}
  std::shared_ptr<const SilhouetteCrop> get(const Dataset& dataset, const SampleId& sample, int camera);

 private:
  std::mutex mutex_;
  std::unordered_map<std::uint64_t, std::shared_ptr<const SilhouetteCrop>> items_;
  std::size_t bytes_ = 0, max_bytes_;
};

/// Loads the items of one batch. All must have the same number of cameras.
Batch build_batch(const Dataset& dataset, SilhouetteCache& cache, const std::vector<SamplePlan::Item>& items,
                  int window);

}  // namespace doppel
