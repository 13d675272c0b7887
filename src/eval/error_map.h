#pragma once

#include <torch/types.h>

#include <opencv2/core.hpp>

#include "doppel/geometry/camera.h"

namespace doppel {

/// Draws a number per vertex on a surface: blue where it is positive, red where it is negative, light grey at 0; at
/// `limit` and beyond the colours are full. Faces that the camera sees at a slant are darker. White background.
/// @param vertices float32 [N,3] world metres @param faces int32 [F,3] @param values float32 [N]
/// @param limit more than 0, in the unit of the values
/// @return 8-bit BGR of the camera's size
cv::Mat draw_vertex_values(const torch::Tensor& vertices, const torch::Tensor& faces, const torch::Tensor& values,
                           const PinholeCamera& camera, double limit);

/// How much nearer each vertex of one surface is to the true surface than that of another (Fig. 4.17). The translation
/// that fits best is removed from both errors, because a single camera does not determine depth.
/// @param better, worse, ground_truth float32 [N,3] metres @return float32 [N] metres: positive where `better` is
/// nearer
torch::Tensor error_improvement(const torch::Tensor& better, const torch::Tensor& worse,
                                const torch::Tensor& ground_truth);

}  // namespace doppel
