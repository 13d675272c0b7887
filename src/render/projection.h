#pragma once

#include <torch/types.h>

#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// Projects points to pixels, differentiable in both arguments (plain tensor operations, any dtype and device).
/// @param points [B,N,3], world, metres
/// @param projection [B,C,3,4], pixels from world metres
/// @return [B,C,N,2] pixels. A point with camera z = 0 gives infinity; behind the camera the result is mirrored.
/// @throws Error for wrong shapes
torch::Tensor project(const torch::Tensor& points, const torch::Tensor& projection);

/// Projection matrices K [R|t] of cameras. @return [C,3,4] of `dtype`
torch::Tensor projection_tensor(const std::vector<PinholeCamera>& cameras, torch::ScalarType dtype = torch::kFloat32);

/// Centres and viewing directions of cameras, from their projection matrices alone.
struct CameraPlacement {
  torch::Tensor centre;   ///< [...,3] world, metres
  torch::Tensor forward;  ///< [...,3] unit vector along the optical axis, world axes
};
/// @param projection [...,3,4] pixels from world metres, of any scale; plain tensor operations
CameraPlacement camera_placement(const torch::Tensor& projection);

/// World points in the axes of each camera. @param points [N,3], world, metres @return [C,N,3] metres
torch::Tensor camera_from_world(const torch::Tensor& points, const std::vector<PinholeCamera>& cameras);

}  // namespace doppel
