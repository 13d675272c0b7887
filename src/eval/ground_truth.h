#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "doppel/core/npy.h"
#include "doppel/data/dataset/dataset.h"

namespace doppel {

/// Reads surfaces of consecutive frames. @return float32 [frames,N,3], metres
/// @throws Error when the file has another shape
torch::Tensor read_surfaces(const std::filesystem::path& path, std::int64_t num_vertices);

/// The ground-truth vertices of the sequences that have them (`ground_truth/<sequence>/vertices.npy`, [frames of the
/// motion,N,3] metres). One frame is read at a time, so the memory does not depend on the number of frames.
class GroundTruth {
 public:
  explicit GroundTruth(const Dataset& dataset);

  /// [N,3], or undefined if the sequence has no ground truth. @throws Error when the file has another shape
  torch::Tensor at(const SampleId& sample, std::int64_t num_vertices);

 private:
  std::vector<std::filesystem::path> paths_;  ///< of each sequence, empty without one
  std::vector<std::optional<NpyItems>> surfaces_;
};

}  // namespace doppel
