#pragma once

#include <torch/types.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

/// The rasterizer once more, in double precision, pixel by pixel and face by face, to hold the real one against.
namespace doppel::test {

/// How a face lies under a pixel centre.
struct Hit {
  bool surely_inside = false;  ///< by more than the margin
  bool surely_outside = false;
  double depth = 0;
  std::array<double, 3> barycentrics{};
};

/// Corners before the division: (u w, v w, w).
using Corners = std::array<std::array<double, 3>, 3>;

inline std::array<double, 3> cross(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Solves for the point of the face's plane under the pixel centre (u, v). `margin` in pixels covers the rounding of
/// corners.
inline Hit hit_face(const Corners& h, double u, double v, double z_near, double margin) {
  Hit hit;
  std::array<double, 3> g{}, distance{};
  double sum = 0, determinant = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto line = cross(h[(k + 1) % 3], h[(k + 2) % 3]);
    g[k] = line[0] * u + line[1] * v + line[2];
    distance[k] = g[k] / std::max(std::hypot(line[0], line[1]), 1e-300);
    sum += g[k];
    if (k == 0) determinant = line[0] * h[0][0] + line[1] * h[0][1] + line[2] * h[0][2];
  }
  hit.depth = determinant / sum;
  for (std::size_t k = 0; k < 3; ++k) hit.barycentrics[k] = g[k] / sum;
  const auto [least, most] = std::minmax({distance[0], distance[1], distance[2]});
  const double nearest = sum < 0 ? -most : least;
  // Seen almost edge-on, rounding may turn the face over, and its plane says little about depth beyond its edges.
  const bool near_edge = std::min(std::abs(least), std::abs(most)) <= margin;
  hit.surely_inside = nearest > margin && hit.depth > z_near * 1.02;
  hit.surely_outside = (least < -margin && most > margin) || (!near_edge && !(hit.depth > z_near * 0.98));
  return hit;
}

inline Corners corners_of(const torch::Tensor& vertices, const torch::Tensor& faces, const torch::Tensor& intrinsics,
                          std::int64_t face) {
  const auto x = vertices.accessor<float, 2>();
  const auto f = faces.accessor<std::int32_t, 2>();
  const auto k = intrinsics.accessor<float, 1>();
  Corners h{};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto i = f[face][static_cast<std::int64_t>(c)];
    h[c] = {static_cast<double>(k[0]) * x[i][0] + static_cast<double>(k[2]) * x[i][2],
            static_cast<double>(k[1]) * x[i][1] + static_cast<double>(k[3]) * x[i][2], x[i][2]};
  }
  return h;
}

}  // namespace doppel::test
