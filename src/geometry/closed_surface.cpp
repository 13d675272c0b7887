#include "doppel/geometry/closed_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "doppel/core/error.h"

namespace doppel {

using Eigen::Vector3d;

namespace {

using Edge = std::array<int, 2>;

/// Relative rounding error of an offset, with respect to the coordinates whose difference it is.
constexpr double kRounding = 1e-14;

/// The first of many edges as text: "3-17, 17-20, ...".
std::string list_edges(const std::vector<Edge>& edges) {
  constexpr std::size_t kShown = 8;
  std::string text;
  for (std::size_t i = 0; i < std::min(edges.size(), kShown); ++i)
    text += fmt::format("{}{}-{}", i ? ", " : "", edges[i][0], edges[i][1]);
  return edges.size() > kShown ? text + ", ..." : text;
}

/// The unit vector of `v`, or 0 for a vector without length.
Vector3d direction_of(const Vector3d& v) {
  const double length = v.norm();
  return length > 0.0 ? Vector3d(v / length) : Vector3d::Zero();
}

}  // namespace

std::vector<Triangle> faces_across_edges(const std::vector<Triangle>& faces) {
  std::map<Edge, std::vector<int>> users;
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int k = 0; k < 3; ++k) users[{faces[f][k], faces[f][(k + 1) % 3]}].push_back(static_cast<int>(f));

  std::vector<Triangle> across(faces.size());
  std::vector<Edge> open, tangled;
  for (const auto& [edge, here] : users) {
    const auto beyond = users.find({edge[1], edge[0]});
    if (here.size() > 1 || edge[0] == edge[1] || (beyond != users.end() && beyond->second.size() > 1)) {
      tangled.push_back(edge);
    } else if (beyond == users.end()) {
      open.push_back(edge);
    } else {
      const Triangle& face = faces[here[0]];
      for (int k = 0; k < 3; ++k)
        if (face[k] == edge[0]) across[here[0]][k] = beyond->second[0];
    }
  }
  if (!open.empty())
    fail(
        "the surface is not closed, so it has no inside: {} edges belong to one face only (by vertices: {}); fill the "
        "holes",
        open.size(), list_edges(open));
  if (!tangled.empty())
    fail(
        "the surface has no clear inside: {} edges belong to more than two faces, or to two wound in opposite senses "
        "(by vertices: {}); every edge must have one face on either side",
        tangled.size(), list_edges(tangled));
  return across;
}

ClosedSurface::ClosedSurface(const std::vector<Vector3d>& vertices, const std::vector<Triangle>& faces)
    : faces_(faces), tree_(vertices, faces) {
  across_ = faces_across_edges(faces);
  move(vertices);
}

void ClosedSurface::move(const std::vector<Vector3d>& vertices) {
  tree_.refit(vertices);
  vertices_ = vertices;
  face_normals_.resize(faces_.size());
  vertex_normals_.assign(vertices.size(), Vector3d::Zero());
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    const Triangle& face = faces_[f];
    const Vector3d normal = (vertices[face[1]] - vertices[face[0]]).cross(vertices[face[2]] - vertices[face[0]]);
    face_normals_[f] = direction_of(normal);
    for (int k = 0; k < 3; ++k) {
      const Vector3d& corner = vertices[face[k]];
      const double cosine = (vertices[face[(k + 1) % 3]] - corner).dot(vertices[face[(k + 2) % 3]] - corner);
      vertex_normals_[face[k]] += std::atan2(normal.norm(), cosine) * face_normals_[f];
    }
  }
}

Vector3d ClosedSurface::normal_at(int face, const std::array<double, 3>& weights) const {
  const int zeros = (weights[0] == 0.0) + (weights[1] == 0.0) + (weights[2] == 0.0);
  if (zeros == 0) return face_normals_[face];
  for (int k = 0; k < 3; ++k) {
    if (zeros == 2 && weights[k] > 0.0) return vertex_normals_[faces_[face][k]];
    if (zeros == 1 && weights[k] == 0.0) return face_normals_[face] + face_normals_[across_[face][(k + 1) % 3]];
  }
  return Vector3d::Zero();
}

ClosedSurface::Hit ClosedSurface::closest(const Vector3d& point, int near_face) const {
  const TriangleTree::Hit found = tree_.closest(point, near_face);
  const Triangle& face = faces_[found.face];
  Vector3d offset = point;
  for (int k = 0; k < 3; ++k) offset -= found.weights[k] * vertices_[face[k]];
  const Vector3d normal = normal_at(found.face, found.weights);
  const double side = offset.dot(normal) < 0.0 ? -1.0 : 1.0;

  Hit hit;
  hit.distance = side * std::sqrt(found.squared_distance);
  hit.face = found.face;
  hit.weights = found.weights;
  // Above a face the offset is parallel to the normal up to rounding. On the surface it consists of rounding only.
  const bool on_face = found.weights[0] > 0.0 && found.weights[1] > 0.0 && found.weights[2] > 0.0;
  const bool on_surface = offset.norm() <= kRounding * (point.norm() + vertices_[face[0]].norm());
  hit.outward = direction_of(on_face || on_surface ? normal : Vector3d(side * offset));
  return hit;
}

}  // namespace doppel
