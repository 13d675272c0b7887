#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/core/npy.h"
#include "doppel/data/dataset/dataset.h"

namespace doppel {

/// Reads surfaces of consecutive frames. @return float32 [frames,N,3], metres
/// @throws Error when the file has another shape
torch::Tensor read_surfaces(const std::filesystem::path& path, std::int64_t num_vertices);

/// A sentence about the first sequence of the splits whose true surfaces have another number of vertices than the
/// character; empty without one. @throws FileError for a file that is no array
std::string ground_truth_of_another_character(const Dataset& dataset, const std::vector<Split>& splits,
                                              std::int64_t num_vertices);

/// The ground-truth vertices of the sequences that have them (`ground_truth/<sequence>/vertices.npy`, [frames of the
/// motion,N,3] metres). One frame is read at a time, so the memory does not depend on the number of frames.
class GroundTruth {
 public:
  /// @param wanted false: as if no sequence had ground truth
  explicit GroundTruth(const Dataset& dataset, bool wanted = true);

  /// Whether the sequence of the sample has ground truth.
  bool has(const SampleId& sample) const;
  /// [N,3], or undefined if the sequence has no ground truth. @throws Error when the file has another shape
  torch::Tensor at(const SampleId& sample, std::int64_t num_vertices);

 private:
  std::vector<std::filesystem::path> paths_;  ///< of each sequence, empty without one
  std::vector<std::optional<NpyItems>> surfaces_;
};

}  // namespace doppel
