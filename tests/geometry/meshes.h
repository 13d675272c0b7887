#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "doppel/geometry/mesh.h"

/// Meshes whose shape and neighbourhoods are known beforehand.
namespace doppel::support {

/// An octahedron split `levels` times onto the sphere of `radius`: 4^levels * 4 + 2 vertices, 8 * 4^levels faces.
inline TriangleMesh make_sphere(int levels, double radius = 1) {
  TriangleMesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (double sign : {1.0, -1.0}) mesh.vertices.push_back(sign * Eigen::Vector3d::Unit(axis));
  }
  mesh.faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<int, int>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto [entry, fresh] = middles.emplace(std::minmax(a, b), mesh.num_vertices());
      if (fresh) mesh.vertices.push_back((mesh.vertices[a] + mesh.vertices[b]).normalized());
      return entry->second;
    };
    std::vector<Triangle> faces;
    for (const auto& [a, b, c] : mesh.faces) {
      const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      faces.insert(faces.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    mesh.faces = faces;
  }
  for (Eigen::Vector3d& v : mesh.vertices) v *= radius;
  return mesh;
}

/// A flat sheet of (columns+1) x (rows+1) vertices in the plane z = 0, row after row, squares of side 1.
inline TriangleMesh make_sheet(int columns, int rows) {
  TriangleMesh mesh;
  for (int y = 0; y <= rows; ++y) {
    for (int x = 0; x <= columns; ++x) mesh.vertices.emplace_back(x, y, 0);
  }
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const int a = y * (columns + 1) + x, b = a + 1, c = a + columns + 1, d = c + 1;
      mesh.faces.push_back({a, b, d});
      mesh.faces.push_back({a, d, c});
    }
  }
  return mesh;
}

/// Distance of a point to a triangle, by projecting onto the face and, where that falls outside, onto its edges.
inline double distance_to_triangle(const Eigen::Vector3d& p, const std::array<Eigen::Vector3d, 3>& corner) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d edge = corner[(i + 1) % 3] - corner[i];
    const double along = std::min(1.0, std::max(0.0, (p - corner[i]).dot(edge) / edge.squaredNorm()));
    best = std::min(best, (corner[i] + along * edge - p).norm());
  }
  const Eigen::Vector3d normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
  const double height = (p - corner[0]).dot(normal);
  const Eigen::Vector3d foot = p - height * normal;
  bool inside = true;
  for (int i = 0; i < 3; ++i)
    inside = inside && (corner[(i + 1) % 3] - corner[i]).cross(foot - corner[i]).dot(normal) >= 0;
  return inside ? std::abs(height) : best;
}

inline double distance_to_mesh(const Eigen::Vector3d& p, const TriangleMesh& mesh) {
  double best = std::numeric_limits<double>::infinity();
  for (const auto& [a, b, c] : mesh.faces) {
    best = std::min(best, distance_to_triangle(p, {mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]}));
  }
  return best;
}

}  // namespace doppel::support
