#pragma once

#include <torch/torch.h>

#include <filesystem>
#include <vector>

#include "doppel/data/dataset.h"

namespace doppel {

/// The true vertices of the sequences that have them (`ground_truth/<sequence>/vertices.npy`, [frames of the
/// motion,N,3] metres), each read once.
class GroundTruth {
 public:
  explicit GroundTruth(const Dataset& dataset);

  /// [N,3], or undefined where the sequence has none. @throws Error when the file's shape does not fit
  torch::Tensor at(const SampleId& sample, std::int64_t num_vertices);

 private:
  std::vector<std::filesystem::path> paths_;  ///< of each sequence, empty without one
  std::vector<torch::Tensor> vertices_;
};

}  // namespace doppel
