#pragma once

/// Chamfer loss (6.27): draws the surface to the points that a radiance field shows in one view.
///
///   L = mean over visible vertices i of eta(min over r of |V_i - p_r|^2)
///     + mean over points r of eta(min over visible i of |p_r - V_i|^2)
///
/// eta(d^2) is d^2 up to the threshold and 0 beyond, where a point does not belong to the surface. Such points still
/// count in the mean. Vertices that the view does not show are excluded: the points lie on the other side of the body,
/// and at thin parts, or where one surface continues inside another, no threshold separates both sides. For the same
/// reason a pair of points with different normals has value 0: near the hem of a skirt the outside, the rim and the
/// underside are all close. Letters: N vertices, R points. Metres.

#include <torch/types.h>

#include "doppel/layers/volume_rendering/volume_rendering.h"

namespace doppel {

/// Surface points at the depths of rays, without gradient (6.26, with the depth divided by the opacity).
/// @param origin [3] or [R,3] @param direction [R,3] unit
/// @param min_opacity rays with a smaller opacity are left out
/// @return [P,3] world, P <= R
torch::Tensor point_cloud(const RenderedRays& rays, const torch::Tensor& origin, const torch::Tensor& direction,
                          double min_opacity = 0.98);

struct ChamferOptions {
  double threshold = 0.04;     ///< of eta, metres
  double min_agreement = 0.5;  ///< smallest cosine between the normals of a pair that counts
};

/// Surface points that one view shows.
struct PointCloud {
  torch::Tensor points;   ///< [R,3]
  torch::Tensor normals;  ///< [R,3] unit normals of the surface at the points
};

/// @param vertices [N,3] @param normals [N,3] unit @param visible bool [N]; undefined: all
/// @return scalar >= 0; a sum without points adds 0
/// Gradient: to the vertices, with fixed nearest neighbours; the cloud is a constant.
/// A tree finds the exact neighbours, for any device and type.
/// @throws UsageError naming the argument, with the shape found, or when a number is not finite
torch::Tensor chamfer_loss(const torch::Tensor& vertices, const torch::Tensor& normals, const PointCloud& cloud,
                           const torch::Tensor& visible = {}, const ChamferOptions& options = {});

}  // namespace doppel
