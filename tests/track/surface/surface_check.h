#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/geometry/topology.h"
#include "doppel/track/surface/surface_term.h"

namespace doppel::support {

/// A bumpy patch of side x side vertices, 5 cm apart, in front of `patch_camera`.
inline TriangleMesh bumpy_patch(int side) {
  TriangleMesh mesh;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) mesh.vertices.emplace_back(0.05 * x, 0.05 * y, 0.02 * std::sin(1.3 * x + 0.7 * y));
  for (int y = 0; y + 1 < side; ++y)
    for (int x = 0; x + 1 < side; ++x) {
      const int a = y * side + x, b = a + 1, c = a + side, d = c + 1;
      mesh.faces.push_back({a, c, b});
      mesh.faces.push_back({b, c, d});
    }
  return mesh;
}

/// Looks along -z at the patch from 2 m.
inline PinholeCamera patch_camera() {
  PinholeCamera camera;
  camera.name = "front";
  camera.width = 200;
  camera.height = 160;
  camera.K << 400.0, 0.0, 92.0, 0.0, 410.0, 83.0, 0.0, 0.0, 1.0;
  camera.R = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  camera.t = Eigen::Vector3d(-0.1, 0.1, 2.0);
  return camera;
}

inline Eigen::Matrix3Xd columns(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) result.col(static_cast<Eigen::Index>(i)) = points[i];
  return result;
}

/// The points, each moved by up to `amount` metres.
inline Eigen::Matrix3Xd shaken(Eigen::Matrix3Xd points, double amount) {
  for (Eigen::Index i = 0; i < points.size(); ++i)
    points.data()[i] += amount * std::sin(12.9898 * static_cast<double>(i + 1));
  return points;
}

/// Holds the jacobian of a term at `vertices` to central differences of its residuals in double; a mismatch is reported
/// with the element, the vertex and the axis. @return how many elements have rows
inline int check_surface_term(SurfaceTerm& term, const std::vector<Link>& edges, const Eigen::Matrix3Xd& vertices,
                              double tolerance = 1e-6) {
  constexpr double kStep = 1e-6;
  term.freeze(vertices);
  const bool on_edges = term.element() == SurfaceTerm::Element::edge;
  const int count = on_edges ? static_cast<int>(edges.size()) : static_cast<int>(vertices.cols());
  int active = 0;
  for (int element = 0; element < count; ++element) {
    const PointRows rows = term.rows(element, vertices);
    active += rows.count > 0;
    for (int end = 0; end < (on_edges ? 2 : 1); ++end) {
      const int vertex = on_edges ? edges[element][end] : element;
      for (int axis = 0; axis < 3; ++axis) {
        const auto at = [&](double step) {
          Eigen::Matrix3Xd moved = vertices;
          moved(axis, vertex) += step;
          return term.rows(element, moved).values;
        };
        const Eigen::Vector3d numeric = (at(kStep) - at(-kStep)) / (2.0 * kStep);
        const Eigen::Vector3d analytic = (end == 0 ? 1.0 : -1.0) * rows.jacobian.col(axis);
        for (int row = 0; row < rows.count; ++row)
          EXPECT_NEAR(analytic[row], numeric[row], tolerance * std::max(1.0, std::abs(numeric[row])))
              << term.name() << ": row " << row << " of " << (on_edges ? "edge " : "vertex ") << element
              << " by vertex " << vertex << " along "
              << "xyz"[axis];
      }
    }
  }
  return active;
}

/// The cost of all elements.
inline double cost_of(const SurfaceTerm& term, int count, const Eigen::Matrix3Xd& vertices) {
  double sum = 0.0;
  for (int element = 0; element < count; ++element) sum += term.rows(element, vertices).cost();
  return sum;
}

}  // namespace doppel::support
