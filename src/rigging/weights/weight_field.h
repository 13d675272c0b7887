#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "doppel/character/skinning_weights.h"

namespace doppel {

/// Skinning weights before the small ones are dropped: [N, Bn], not negative, of sum 1 in each row.
using WeightField = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The weights that remain of one vertex: at most six of at least 0.01, largest first, scaled to sum 1.
struct SparseRow {
  std::vector<int> bones;
  std::vector<double> weights;
};
SparseRow sparse_row(const WeightField& field, int vertex);

/// @param bones [Bn] names
SkinningWeights sparse_weights(const WeightField& field, const std::vector<std::string>& bones);

}  // namespace doppel
