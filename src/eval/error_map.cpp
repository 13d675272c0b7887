#include "doppel/eval/error_map.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"

namespace doppel {

using torch::Tensor;

namespace {

const cv::Vec3f kBlue(190, 90, 20), kRed(30, 30, 200), kZero(225, 225, 225);  // BGR

cv::Vec3f colour_of(float value) {
  const float share = std::min(1.0f, std::abs(value));
  return (1.0f - share) * kZero + share * (value > 0.0f ? kBlue : kRed);
}

/// |cosine| between the normal of each face and its line of sight. @return float32 [F]
Tensor face_slant(const Tensor& corners, const PinholeCamera& camera) {
  const Eigen::Vector3d centre = camera.centre();
  const Tensor eye = torch::tensor({centre.x(), centre.y(), centre.z()}, torch::kFloat32);
  const Tensor normal =
      at::cross(corners.select(1, 1) - corners.select(1, 0), corners.select(1, 2) - corners.select(1, 0), 1);
  const Tensor sight = corners.mean(1) - eye;
  return ((normal * sight).sum(1) / (normal.norm(2, 1) * sight.norm(2, 1)).clamp_min(1e-12)).abs();
}

Tensor errors_without_translation(const Tensor& found, const Tensor& ground_truth) {
  const Tensor difference = found - ground_truth;
  return (difference - difference.mean(0, true)).norm(2, 1);
}

}  // namespace

cv::Mat draw_vertex_values(const Tensor& vertices, const Tensor& faces, const Tensor& values,
                           const PinholeCamera& camera, double limit) {
  if (!(limit > 0.0)) fail<UsageError>("the limit of the colours is {}; it must be more than 0", limit);
  const Tensor index = faces.to(torch::kInt64);
  const Tensor corners = vertices.index_select(0, index.flatten()).view({-1, 3, 3});
  const Tensor corner_values = values.index_select(0, index.flatten()).view({-1, 3}).contiguous();
  const Tensor light = (0.55 + 0.45 * face_slant(corners, camera)).contiguous();
  Rasterizer rasterizer(faces);
  const RasterImage& image = rasterizer.rasterize_projected(
      vertices.unsqueeze(0), projection_tensor({camera}).view({1, 1, 3, 4}), camera.height, camera.width);
  const int* face_id = image.face_id.data_ptr<int>();
  const float* barycentrics = image.barycentrics.data_ptr<float>();
  const auto value_of = corner_values.accessor<float, 2>();
  const auto light_of = light.accessor<float, 1>();
  cv::Mat drawing(camera.height, camera.width, CV_8UC3, cv::Scalar::all(255));
  for (int pixel = 0; pixel < camera.height * camera.width; ++pixel) {
    const int face = face_id[pixel];
    if (face < 0) continue;
    float value = 0.0f;
    for (int corner = 0; corner < 3; ++corner) value += barycentrics[3 * pixel + corner] * value_of[face][corner];
    drawing.at<cv::Vec3b>(pixel) = light_of[face] * colour_of(value / static_cast<float>(limit));
  }
  return drawing;
}

Tensor error_improvement(const Tensor& better, const Tensor& worse, const Tensor& ground_truth) {
  return errors_without_translation(worse, ground_truth) - errors_without_translation(better, ground_truth);
}

}  // namespace doppel
