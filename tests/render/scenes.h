#pragma once

#include <torch/types.h>

#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "doppel/core/as_size.h"

/// Meshes for the tests of the rasterizer and of what is built on it.
namespace doppel::test {

struct Mesh {
  torch::Tensor vertices;  ///< float32 [N,3]
  torch::Tensor faces;     ///< int32 [F,3]
};

/// Unrelated triangles in front of, around and behind a camera at the origin; some share edges, some have no area, some
/// are seen edge-on, some cross the camera plane.
inline Mesh triangle_soup(std::mt19937& random, int num_faces) {
  std::uniform_real_distribution<float> unit(-1, 1);
  std::vector<float> points;
  std::vector<std::int32_t> faces;
  const auto vertex = [&](float depth, float spread) {
    points.insert(points.end(), {spread * unit(random), spread * unit(random), depth});
    return static_cast<std::int32_t>(points.size() / 3 - 1);
  };
  for (int f = 0; f < num_faces; ++f) {
    const int kind = static_cast<int>(random() % 10);
    const float depth = 2 + unit(random);
    std::int32_t a = vertex(depth + 0.3f * unit(random), depth * 0.7f),
                 b = vertex(depth + 0.3f * unit(random), depth * 0.7f);
    std::int32_t c = vertex(depth + 0.3f * unit(random), depth * 0.7f);
    if (kind == 0) c = vertex(-unit(random), 1);                                       // beyond or behind the camera
    if (kind == 1) c = b;                                                              // no area
    if (kind == 2 && f > 0) a = faces[faces.size() - 3], b = faces[faces.size() - 2];  // shared edge
    if (kind == 3) a = vertex(-0.5f, 1), b = vertex(-0.5f, 1), c = vertex(-1, 1);      // behind
    if (kind == 4) a = vertex(0.002f, 0.5f), b = vertex(1, 1);                         // crosses the near plane
    if (kind == 5) {  // edge-on: in a plane through the camera
      const std::size_t k = as_size(c);
      for (std::size_t i = 0; i < 3; ++i) {
        points[3 * k + i] = 0.8f * points[3 * as_size(a) + i] + 0.4f * points[3 * as_size(b) + i];
      }
    }
    if (kind >= 8) {  // small
      for (const std::int32_t i : {b, c}) {
        for (std::size_t k = 0; k < 3; ++k) {
          points[3 * as_size(i) + k] = points[3 * as_size(a) + k] + 0.02f * unit(random);
        }
      }
    }
    faces.insert(faces.end(), {a, b, c});
  }
  return {torch::tensor(points).reshape({-1, 3}), torch::tensor(faces, torch::kInt32).reshape({-1, 3})};
}

/// A sphere of `rings` x 2 `rings` quadrilaterals, counter-clockwise from outside (y up, right-handed).
inline Mesh sphere(int rings, float radius) {
  const int columns = 2 * rings;
  std::vector<float> points{0, radius, 0, 0, -radius, 0};
  std::vector<std::int32_t> faces;
  const auto id = [&](int r, int c) { return 2 + (r - 1) * columns + (c + columns) % columns; };
  for (int r = 1; r < rings; ++r) {
    for (int c = 0; c < columns; ++c) {
      const double theta = M_PI * r / rings, phi = 2 * M_PI * c / columns;
      points.insert(points.end(), {static_cast<float>(radius * std::sin(theta) * std::sin(phi)),
                                   static_cast<float>(radius * std::cos(theta)),
                                   static_cast<float>(radius * std::sin(theta) * std::cos(phi))});
    }
  }
  for (int c = 0; c < columns; ++c) {
    faces.insert(faces.end(), {0, id(1, c), id(1, c + 1)});
    faces.insert(faces.end(), {1, id(rings - 1, c + 1), id(rings - 1, c)});
    for (int r = 1; r + 1 < rings; ++r) {
      faces.insert(faces.end(), {id(r, c), id(r + 1, c), id(r + 1, c + 1)});
      faces.insert(faces.end(), {id(r, c), id(r + 1, c + 1), id(r, c + 1)});
    }
  }
  return {torch::tensor(points).reshape({-1, 3}), torch::tensor(faces, torch::kInt32).reshape({-1, 3})};
}

/// A camera at distance * (sin angle, 0, -cos angle), metres, that looks at the origin: K [R|t], float64 [3,4].
inline torch::Tensor orbit_projection(double angle, double distance, double focal, double size) {
  const double s = std::sin(angle), c = std::cos(angle);
  const torch::Tensor rotation =  // rows: right, down, forward
      torch::tensor({-c, 0.0, -s, 0.0, -1.0, 0.0, -s, 0.0, c}, torch::kFloat64).reshape({3, 3});
  const torch::Tensor t = torch::tensor({0.0, 0.0, distance}, torch::kFloat64).unsqueeze(1);
  const torch::Tensor k =
      torch::tensor({focal, 0.0, size / 2, 0.0, focal, size / 2, 0.0, 0.0, 1.0}, torch::kFloat64).reshape({3, 3});
  return torch::matmul(k, torch::cat({rotation, t}, 1));
}

/// Two spheres, each seen by three cameras around it.
struct SphereViews {
  static constexpr std::int64_t kSize = 75;  ///< pixels along a side
  Mesh mesh = sphere(16, 0.5f);
  torch::Tensor vertices = torch::stack({mesh.vertices, mesh.vertices * 0.8 + 0.1});  ///< [2,N,3]
  torch::Tensor projection = make_projection();                                       ///< float32 [2,3,3,4]

  static torch::Tensor make_projection() {
    std::vector<torch::Tensor> cameras;
    for (const double angle : {0.0, 1.0, 2.5}) cameras.push_back(orbit_projection(angle, 3, 150, kSize));
    const torch::Tensor one = torch::stack(cameras).to(torch::kFloat32);
    return torch::stack({one, one});
  }
};

}  // namespace doppel::test
