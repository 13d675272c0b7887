#pragma once

/// Chamfer loss (6.27): the surface goes where the radiance field of one view saw it.
///
///   L = mean over visible vertices i of eta(min over r of |V_i - p_r|^2)
///     + mean over points r of eta(min over visible i of |p_r - V_i|^2)
///
/// eta(d^2) is d^2 up to the threshold and 0 beyond, where a point has nothing to do with the surface; such points
/// still count in the mean. Vertices that the view does not show take no part: the cloud lies on their wrong side, and
/// where a body part is thin, or a surface goes on inside another, no threshold would keep it off. For the same reason
/// a pair whose normals disagree counts 0, as one beyond the threshold does: at the hem of a skirt the outside, the rim
/// and the underside are all near. Letters: N vertices, R points. Metres.

#include <torch/torch.h>

#include "doppel/layers/volume_rendering/volume_rendering.h"

namespace doppel {

/// Points of the surface that rays saw, without gradient (6.26, with the depth divided by the opacity).
/// @param origin [3] or [R,3] @param direction [R,3] unit
/// @param min_opacity rays that saw less are left out
/// @return [P,3] world, P <= R
torch::Tensor point_cloud(const RenderedRays& rays, const torch::Tensor& origin, const torch::Tensor& direction,
                          double min_opacity = 0.98);

struct ChamferOptions {
  double threshold = 0.04;       ///< metres, of eta
  double min_agreement = 0.5;  ///< cosine between the normals of a pair that counts
};

/// Points that one view saw.
struct PointCloud {
  torch::Tensor points;   ///< [R,3]
  torch::Tensor normals;  ///< [R,3] unit, of the surface there
};

/// @param vertices [N,3] @param normals [N,3] unit @param visible bool [N]; undefined: all
/// @return scalar >= 0; a direction without points adds 0
/// Gradient: to the vertices, with the nearest neighbours kept; the cloud counts as given.
/// The neighbours are found exactly, by a tree, whatever the device and type.
/// @throws UsageError naming the argument, with the shape found, or when a number is not finite
torch::Tensor chamfer_loss(const torch::Tensor& vertices, const torch::Tensor& normals, const PointCloud& cloud,
                           const torch::Tensor& visible = {}, const ChamferOptions& options = {});

}  // namespace doppel
