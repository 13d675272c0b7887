#pragma once

#include "doppel/io/figure_export/figure_clip.h"

namespace doppel {

/// Displacements of the rest vertices: mean + components * weights.
struct CorrectiveShapes {
  Eigen::VectorXf mean;        ///< [3N] metres
  Eigen::MatrixXf components;  ///< [3N, K] orthonormal

  /// The weights with the least squared distance, metres: [K]
  Eigen::VectorXf weights_of(const Eigen::VectorXf& displacements) const {
    return components.transpose() * (displacements - mean);
  }
};

/// Mean and principal components. @param displacements [3N, S] @param count largest number of components
CorrectiveShapes corrective_shapes(Eigen::MatrixXf displacements, int count);

/// The shapes as targets for weights of 0 to 1: `Corrective_Base` has weight 1, and a weight of 0 and 1 of
/// `Corrective_1`, ... stands for the weights low and high of the components. @param low, high [K] metres
/// @return without weights of frames
MorphTargets corrective_targets(const CorrectiveShapes& shapes, const Eigen::VectorXf& low,
                                const Eigen::VectorXf& high);

}  // namespace doppel
