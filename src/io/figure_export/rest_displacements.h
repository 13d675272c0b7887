#pragma once

#include <Eigen/Core>
#include <span>

#include "doppel/io/figure_export/figure.h"

namespace doppel {

/// The displacements d of the rest vertices b with M (b + d) = v, in the least-squares sense with a small damping.
/// @param blended [N] the matrices M (blend_transforms) @param vertices v [3N] world, metres @return [3N] metres
Eigen::VectorXf unposed_displacements(const Figure& figure, const std::vector<Eigen::Affine3d>& blended,
                                      std::span<const float> vertices);

/// Displacements of the rest vertices as mean + components * weights.
struct LinearShapes {
  Eigen::VectorXf mean;        ///< [3N] metres
  Eigen::MatrixXf components;  ///< [3N, K] orthonormal

  /// The weights with the least squared distance, metres: [K]
  Eigen::VectorXf weights_of(const Eigen::VectorXf& displacements) const {
    return components.transpose() * (displacements - mean);
  }
};

/// Mean and principal components, largest first.
/// @param displacements [3N, S] @param count largest number of components; fewer are found where fewer are there
LinearShapes linear_shapes(Eigen::MatrixXf displacements, int count);

/// One row a vertex. @param displacements [3N]
Eigen::MatrixX3f target_rows(const Eigen::VectorXf& displacements);

}  // namespace doppel
