#pragma once

#include <Eigen/Core>
#include <span>

#include "doppel/io/figure_export/figure.h"

namespace doppel {

/// The displacements d of the rest vertices b with M (b + d) = v, in the least-squares sense with a small damping.
/// @param blended [N] the matrices M (blend_transforms) @param vertices v [3N] world, metres @return [3N] metres
Eigen::VectorXf unposed_displacements(const Figure& figure, const std::vector<Eigen::Affine3d>& blended,
                                      std::span<const float> vertices);

/// Orthonormal components of columns from which their mean was subtracted, largest first.
/// @param columns [3N, S] @param count largest number of components; fewer are found where fewer are there
/// @return [3N, K]
Eigen::MatrixXf principal_components(const Eigen::MatrixXf& columns, int count);

}  // namespace doppel
