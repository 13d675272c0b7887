#include "doppel/rigging/scan/winding_number.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "doppel/rigging/scan/scan_parts.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr int kLeafSize = 8;
constexpr double kFarRadii = 2.3;  // of a group: beyond, it counts as one dipole
/// Each level halves the triangles, so no tree of int-indexed triangles is deeper; a level leaves one node waiting.
constexpr int kStackSize = 64;

/// The solid angle of a triangle seen from the origin, over 2 (van Oosterom & Strackee 1983).
double half_solid_angle(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

WindingNumber::WindingNumber(const TriangleMesh& mesh) {
  check_scan_mesh(mesh, "finding the inside of a mesh");
  std::vector<Vector3d> centres(mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Triangle& face = mesh.faces[f];
    centres[f] = (mesh.vertices[face[0]] + mesh.vertices[face[1]] + mesh.vertices[face[2]]) / 3.0;
  }
  std::vector<int> order(mesh.faces.size());
  std::iota(order.begin(), order.end(), 0);
  nodes_.push_back({Vector3d::Zero(), Vector3d::Zero(), 0.0, 0, static_cast<int>(order.size())});
  std::vector<std::array<int, 2>> ranges{{0, static_cast<int>(order.size())}};
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    const auto [first, last] = ranges[n];
    if (last - first <= kLeafSize) continue;
    Vector3d low = centres[order[first]], high = low;
    for (int i = first; i < last; ++i) {
      low = low.cwiseMin(centres[order[i]]);
      high = high.cwiseMax(centres[order[i]]);
    }
    int axis = 0;
    (high - low).maxCoeff(&axis);
    const int middle = first + (last - first) / 2;
    std::nth_element(order.begin() + first, order.begin() + middle, order.begin() + last,
                     [&](int a, int b) { return std::pair(centres[a][axis], a) < std::pair(centres[b][axis], b); });
    nodes_[n].first = static_cast<int>(nodes_.size());
    nodes_[n].count = 0;
    for (const auto& [from, to] : {std::pair(first, middle), std::pair(middle, last)}) {
      nodes_.push_back({Vector3d::Zero(), Vector3d::Zero(), 0.0, from, to - from});
      ranges.push_back({from, to});
    }
  }
  triangles_.reserve(order.size());
  for (const int f : order) {
    const Triangle& face = mesh.faces[f];
    triangles_.push_back({{mesh.vertices[face[0]], mesh.vertices[face[1]], mesh.vertices[face[2]]}});
  }
  for (std::size_t n = nodes_.size(); n-- > 0;) summarise(n, ranges[n]);
}

void WindingNumber::summarise(std::size_t index, const std::array<int, 2>& range) {
  Node& node = nodes_[index];
  double total = 0.0;
  Vector3d weighted = Vector3d::Zero(), plain = Vector3d::Zero();
  for (int i = range[0]; i < range[1]; ++i) {
    const auto& [a, b, c] = triangles_[i].p;
    const Vector3d area = 0.5 * (b - a).cross(c - a), centre = (a + b + c) / 3.0;
    node.area += area;
    total += area.norm();
    weighted += area.norm() * centre;
    plain += centre;
  }
  node.centre = total > 0.0 ? Vector3d(weighted / total) : Vector3d(plain / std::max(1, range[1] - range[0]));
  double radius = 0.0;
  for (int i = range[0]; i < range[1]; ++i)
    for (const Vector3d& corner : triangles_[i].p) radius = std::max(radius, (corner - node.centre).squaredNorm());
  node.far = kFarRadii * kFarRadii * radius;
}

double WindingNumber::at(const Vector3d& point) const {
  std::array<int, kStackSize> stack;
  int depth = 0;
  stack[0] = 0;
  double dipoles = 0.0, angles = 0.0;
  while (depth >= 0) {
    const Node& node = nodes_[stack[depth--]];
    const Vector3d offset = node.centre - point;
    const double squared = offset.squaredNorm();
    if (squared > node.far) {
      dipoles += node.area.dot(offset) / (squared * std::sqrt(squared));
    } else if (node.count > 0) {
      for (int i = node.first; i < node.first + node.count; ++i) {
        const auto& [a, b, c] = triangles_[i].p;
        angles += half_solid_angle(a - point, b - point, c - point);
      }
    } else {
      stack[++depth] = node.first;
      stack[++depth] = node.first + 1;
    }
  }
  return dipoles / (4.0 * std::numbers::pi) + angles / (2.0 * std::numbers::pi);
}

}  // namespace doppel
