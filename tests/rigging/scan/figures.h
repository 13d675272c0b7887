#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "doppel/geometry/mesh.h"

/// Bodies of known shape.
namespace doppel::support {

inline void append(TriangleMesh& mesh, const TriangleMesh& other) {
  const int first = mesh.num_vertices();
  mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const Triangle& f : other.faces) mesh.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
}

/// A closed box, faces outwards.
inline TriangleMesh make_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  TriangleMesh mesh;
  for (int k = 0; k < 8; ++k)
    mesh.vertices.emplace_back(k & 1 ? high.x() : low.x(), k & 2 ? high.y() : low.y(), k & 4 ? high.z() : low.z());
  mesh.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

/// A closed tube with round ends between two points.
inline TriangleMesh make_limb(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius) {
  constexpr int kAround = 16, kCap = 5;
  TriangleMesh mesh;
  const Eigen::Vector3d axis = (b - a).normalized(), u = axis.unitOrthogonal(), v = axis.cross(u);
  mesh.vertices.push_back(a - radius * axis);
  for (int ring = 0; ring < 2 * kCap; ++ring) {
    const bool far = ring >= kCap;
    const double angle = 0.5 * std::numbers::pi * (far ? ring - kCap : ring + 1 - kCap) / kCap;
    const Eigen::Vector3d middle = (far ? b : a) + radius * std::sin(angle) * axis;
    for (int k = 0; k < kAround; ++k) {
      const double turn = 2.0 * std::numbers::pi * k / kAround;
      mesh.vertices.push_back(middle + radius * std::cos(angle) * (std::cos(turn) * u + std::sin(turn) * v));
    }
  }
  mesh.vertices.push_back(b + radius * axis);
  const auto at = [](int ring, int k) { return 1 + ring * kAround + k % kAround; };
  for (int k = 0; k < kAround; ++k) {
    mesh.faces.push_back({0, at(0, k + 1), at(0, k)});
    for (int ring = 0; ring + 1 < 2 * kCap; ++ring) {
      mesh.faces.push_back({at(ring, k), at(ring, k + 1), at(ring + 1, k)});
      mesh.faces.push_back({at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)});
    }
    mesh.faces.push_back({mesh.num_vertices() - 1, at(2 * kCap - 1, k), at(2 * kCap - 1, k + 1)});
  }
  return mesh;
}

/// A standing figure of limbs, 1.75 m high, y up, facing +z. @param left_hand, right_hand relative to the shoulders
inline TriangleMesh make_figure(const Eigen::Vector3d& left_hand, const Eigen::Vector3d& right_hand) {
  TriangleMesh body;
  const auto limb = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius) {
    append(body, make_limb(a, b, radius));
  };
  for (const double side : {1.0, -1.0}) {
    limb({side * 0.11, 0.05, -0.03}, {side * 0.12, 0.04, 0.15}, 0.04);
    limb({side * 0.11, 0.05, -0.02}, {side * 0.10, 0.50, 0.0}, 0.05);
    limb({side * 0.10, 0.50, 0.0}, {side * 0.09, 0.90, 0.0}, 0.075);
    const Eigen::Vector3d shoulder(side * 0.2, 1.40, 0.0);
    limb(shoulder, shoulder + (side > 0 ? left_hand : right_hand), 0.045);
  }
  limb({0, 0.95, 0}, {0, 1.33, 0}, 0.15);
  limb({-0.17, 1.40, 0}, {0.17, 1.40, 0}, 0.08);
  limb({0, 1.40, 0}, {0, 1.55, 0}, 0.055);
  limb({0, 1.60, 0.01}, {0, 1.65, 0.01}, 0.10);
  return body;
}

/// A round level sheet.
inline TriangleMesh make_disc(double height, double radius) {
  TriangleMesh mesh;
  mesh.vertices.emplace_back(0, height, 0);
  constexpr int kRings = 8, kAround = 48;
  for (int ring = 1; ring <= kRings; ++ring)
    for (int k = 0; k < kAround; ++k) {
      const double turn = 2.0 * std::numbers::pi * k / kAround, r = radius * ring / kRings;
      mesh.vertices.emplace_back(r * std::cos(turn), height, r * std::sin(turn));
    }
  for (int k = 0; k < kAround; ++k) {
    const int next = (k + 1) % kAround;
    mesh.faces.push_back({0, 1 + next, 1 + k});
    for (int ring = 0; ring + 1 < kRings; ++ring) {
      const int a = 1 + ring * kAround + k, b = 1 + ring * kAround + next, c = a + kAround, d = b + kAround;
      mesh.faces.push_back({a, b, c});
      mesh.faces.push_back({b, d, c});
    }
  }
  return mesh;
}

/// An open cylinder about y from 0 to `height`, unrolled in the texture: u around, v along, with a seam at u = 0 = 1.
inline TriangleMesh make_cylinder(int around, int along, double radius, double height) {
  TriangleMesh mesh;
  for (int j = 0; j <= along; ++j)
    for (int k = 0; k < around; ++k) {
      const double turn = 2.0 * std::numbers::pi * k / around;
      mesh.vertices.emplace_back(radius * std::sin(turn), height * j / along, radius * std::cos(turn));
    }
  for (int j = 0; j <= along; ++j)
    for (int k = 0; k <= around; ++k)
      mesh.uvs.emplace_back(static_cast<double>(k) / around, static_cast<double>(j) / along);
  const auto add = [&](int j0, int k0, int j1, int k1, int j2, int k2) {
    mesh.faces.push_back({j0 * around + k0 % around, j1 * around + k1 % around, j2 * around + k2 % around});
    mesh.face_uvs.push_back({j0 * (around + 1) + k0, j1 * (around + 1) + k1, j2 * (around + 1) + k2});
  };
  for (int j = 0; j < along; ++j)
    for (int k = 0; k < around; ++k) {
      add(j, k, j, k + 1, j + 1, k);
      add(j, k + 1, j + 1, k + 1, j + 1, k);
    }
  return mesh;
}

}  // namespace doppel::support
