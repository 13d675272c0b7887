#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "doppel/character/skinning_weights.h"
#include "doppel/rigging/weights/heat_options.h"

namespace doppel {

/// Skinning weights before the small ones are dropped: [N, Bn], not negative, of sum 1 in each row.
using WeightField = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The weights that remain of one vertex, largest first, of sum 1.
struct SparseRow {
  std::vector<int> bones;
  std::vector<double> weights;
};
SparseRow sparse_row(const WeightField& field, int vertex, const HeatOptions& options);

/// @param bones [Bn] names
SkinningWeights sparse_weights(const WeightField& field, const std::vector<std::string>& bones,
                               const HeatOptions& options);

}  // namespace doppel
