#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "doppel/data/dataset/batch.h"
#include "doppel/data/dataset/dataset.h"
#include "doppel/data/dataset/sampling.h"

namespace doppel {

/// Caches distance fields and decoded images in memory up to a common budget. The first items stay, because every epoch
/// visits all samples. The cache never changes the results. Thread-safe.
class CropCache {
 public:
  explicit CropCache(std::size_t max_bytes) : max_bytes_(max_bytes) {}
  std::shared_ptr<const SilhouetteCrop> silhouette(const Dataset& dataset, const SampleId& sample, int camera);
  /// @param pixels must be the same in all calls
  std::shared_ptr<const ImageCrop> image(const Dataset& dataset, const SampleId& sample, int camera, int pixels);
  /// The same for the images of persons, which have their own resolution and are cached separately.
  std::shared_ptr<const ImageCrop> person(const Dataset& dataset, const SampleId& sample, int camera, int pixels);

 private:
  template <typename Crop>
  using Items = std::unordered_map<std::uint64_t, std::shared_ptr<const Crop>>;
  template <typename Crop, typename Make>
  std::shared_ptr<const Crop> get(Items<Crop>& items, std::uint64_t key, const Make& make);

  std::mutex mutex_;
  Items<SilhouetteCrop> silhouettes_;
  Items<ImageCrop> images_, people_;
  std::size_t bytes_ = 0, max_bytes_;
};

/// Loads the items of one batch. All must have the same number of cameras.
Batch build_batch(const Dataset& dataset, CropCache& cache, const std::vector<SamplePlan::Item>& items,
                  const BatchOptions& options);

/// Loads a batch of given samples with given cameras, without a loader (evaluation, overlays).
/// @param cameras of each sample, all lists of the same length
/// @throws UsageError when there are no samples, or for images larger than the stored ones
Batch make_batch(const Dataset& dataset, const std::vector<SampleId>& samples,
                 const std::vector<std::vector<int>>& cameras, const BatchOptions& options);

}  // namespace doppel
