#pragma once

/// The work of the layer benchmarks: a body of 5,514 vertices with 6 bones and 6 graph nodes per vertex. With
/// DOPPEL_SHARED it is the real test character, without it an ellipsoid of the same size.

#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "doppel/character/character.h"

namespace doppel::bench {

struct Body {
  std::vector<Eigen::Vector3d> vertices;
  SkinningWeights skin;                ///< 70 bones
  std::vector<Eigen::Vector3d> nodes;  ///< 500, farthest points of the vertices
  IndexRows vertex_nodes;
  std::vector<double> node_weights;
};

inline std::vector<Eigen::Vector3d> ellipsoid(int count) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double y = 1.0 - 2.0 * (i + 0.5) / count, r = std::sqrt(1.0 - y * y), a = 2.399963229728653 * i;
    points.emplace_back(0.35 * r * std::cos(a), 0.88 * (1.0 + y), 0.22 * r * std::sin(a));
  }
  return points;
}

/// Indices of `count` points, each the farthest from those before it.
inline std::vector<int> farthest_points(const std::vector<Eigen::Vector3d>& points, int count) {
  std::vector<double> distance(points.size(), 1e300);
  std::vector<int> chosen{0};
  while (static_cast<int>(chosen.size()) < count) {
    for (size_t i = 0; i < points.size(); ++i) {
      distance[i] = std::min(distance[i], (points[i] - points[chosen.back()]).squaredNorm());
    }
    chosen.push_back(static_cast<int>(std::max_element(distance.begin(), distance.end()) - distance.begin()));
  }
  return chosen;
}

/// The `nearest` anchors of each point, nearest first, with weights (1 - d / (1.05 d_max))^2 that sum to 1.
inline void attach(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& anchors, int nearest,
                   IndexRows& rows, std::vector<double>& weights) {
  for (const auto& point : points) {
    std::vector<std::pair<double, int>> order;
    for (size_t a = 0; a < anchors.size(); ++a) order.emplace_back((point - anchors[a]).norm(), static_cast<int>(a));
    std::partial_sort(order.begin(), order.begin() + nearest, order.end());
    double sum = 0.0;
    std::vector<double> row;
    for (int i = 0; i < nearest; ++i) {
      const double w = 1.0 - order[i].first / (1.05 * std::max(order[nearest - 1].first, 1e-9));
      row.push_back(w * w);
      sum += row.back();
    }
    for (int i = 0; i < nearest; ++i) {
      rows.items.push_back(order[i].second);
      weights.push_back(row[i] / sum);
    }
    rows.offsets.push_back(static_cast<int>(rows.items.size()));
  }
}

inline Body make_body() {
  Body body;
  if (const char* shared = std::getenv("DOPPEL_SHARED")) {
    const auto folder = std::filesystem::path(shared) / "captures" / "s22" / "character";
    body.vertices = read_obj(folder / "ddc.obj", 0.001).vertices;
    body.skin = read_skin(folder / "ddc.skin");
    while (body.skin.bones.size() < 70) body.skin.bones.push_back("none");
  } else {
    body.vertices = ellipsoid(5514);
    std::vector<Eigen::Vector3d> centres;
    for (int i : farthest_points(body.vertices, 70)) centres.push_back(body.vertices[i]);
    attach(body.vertices, centres, 6, body.skin.vertex_bones, body.skin.weights);
    body.skin.bones.assign(70, "bone");
  }
  for (int i : farthest_points(body.vertices, 500)) body.nodes.push_back(body.vertices[i]);
  attach(body.vertices, body.nodes, 6, body.vertex_nodes, body.node_weights);
  return body;
}

/// Eager forms read influences as [N,P] tensors, or as one dense [N,columns] matrix.
inline torch::Tensor dense_matrix(const torch::Tensor& items, const torch::Tensor& weights, int64_t columns) {
  return torch::zeros({items.size(0), columns}).scatter_add_(1, items, weights);
}

inline torch::Tensor points_tensor(const std::vector<Eigen::Vector3d>& points) {
  torch::Tensor result = torch::empty({static_cast<int64_t>(points.size()), 3});
  for (size_t i = 0; i < points.size(); ++i) {
    for (int c = 0; c < 3; ++c) result.data_ptr<float>()[3 * i + c] = static_cast<float>(points[i][c]);
  }
  return result;
}

/// Largest absolute difference, for the check before timing.
inline double difference(const torch::Tensor& a, const torch::Tensor& b) { return (a - b).abs().max().item<double>(); }

}  // namespace doppel::bench
