#include "doppel/geometry/triangle_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr int kLeafTriangles = 4;
/// Boxes halve the number of triangles level by level; no tree of int-indexed triangles is deeper.
constexpr int kMaxDepth = 64;
/// Margin of the boxes, relative to the largest coordinate, so that rounding cannot put a triangle outside its box.
constexpr double kPadding = 1e-14;

void try_segment(const Vector3d& p, const std::array<Vector3d, 3>& corners, int from, int to, TrianglePoint& best) {
  const Vector3d along = corners[to] - corners[from], start = p - corners[from];
  const double length = along.squaredNorm();
  const double t = length > 0.0 ? std::clamp(start.dot(along) / length, 0.0, 1.0) : 0.0;
  const double distance = (start - t * along).squaredNorm();
  if (distance >= best.squared_distance) return;
  best.squared_distance = distance;
  best.weights = {};
  best.weights[from] = 1.0 - t;
  best.weights[to] = t;
}

void check_faces(std::size_t num_vertices, const std::vector<Triangle>& faces) {
  if (faces.empty()) fail<UsageError>("distance to a surface: it must have at least one face");
  for (const Triangle& face : faces)
    for (int vertex : face)
      if (vertex < 0 || as_size(vertex) >= num_vertices)
        fail<UsageError>("distance to a surface: a face names vertex {}, but there are {}", vertex, num_vertices);
}

}  // namespace

TrianglePoint closest_on_triangle(const Vector3d& p, const std::array<Vector3d, 3>& t) {
  const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]);
  const double area = normal.squaredNorm();
  // Barycentric coordinates of the foot of the perpendicular, up to a factor; negative beyond the opposite edge.
  const std::array<double, 3> parts{(t[2] - t[1]).cross(p - t[1]).dot(normal),
                                    (t[0] - t[2]).cross(p - t[2]).dot(normal),
                                    (t[1] - t[0]).cross(p - t[0]).dot(normal)};
  TrianglePoint best;
  if (area > 0.0 && parts[0] >= 0.0 && parts[1] >= 0.0 && parts[2] >= 0.0) {
    const double height = (p - t[0]).dot(normal), sum = parts[0] + parts[1] + parts[2];
    best.squared_distance = height * height / area;
    for (int k = 0; k < 3; ++k) best.weights[k] = parts[k] / sum;
    return best;
  }
  // The closest point can only lie on an edge that separates the foot from the triangle.
  for (int k = 0; k < 3; ++k)
    if (!(area > 0.0) || parts[k] < 0.0) try_segment(p, t, (k + 1) % 3, (k + 2) % 3, best);
  return best;
}

double TriangleTree::Box::squared_distance(const Vector3d& point) const {
  return (low - point).cwiseMax(point - high).cwiseMax(Vector3d::Zero()).squaredNorm();
}

TriangleTree::TriangleTree(const std::vector<Vector3d>& vertices, const std::vector<Triangle>& faces)
    : num_vertices_(static_cast<int>(vertices.size())), faces_(faces) {
  check_faces(vertices.size(), faces);
  std::vector<Vector3d> centres;
  for (const Triangle& f : faces) {
    centres.emplace_back(vertices[f[0]] + vertices[f[1]] + vertices[f[2]]);
    triangles_.push_back({{vertices[f[0]], vertices[f[1]], vertices[f[2]]}, static_cast<int>(triangles_.size())});
  }
  // Checked before any comparison sorts by them.
  for (const Vector3d& centre : centres)
    if (!centre.allFinite()) fail<UsageError>("distance to a surface: a vertex of a face is not finite");
  nodes_.push_back({{Vector3d::Zero(), Vector3d::Zero()}, 0, num_faces()});
  for (std::size_t node = 0; node < nodes_.size(); ++node) split(node, centres);
  place_.resize(faces.size());
  for (int i = 0; i < num_faces(); ++i) place_[triangles_[i].face] = i;
  refit(vertices);
}

void TriangleTree::split(std::size_t node, const std::vector<Vector3d>& centres) {
  const auto [box, first, count] = nodes_[node];
  if (count <= kLeafTriangles) return;
  const auto begin = triangles_.begin() + first, middle = begin + count / 2, end = begin + count;
  Vector3d low = centres[begin->face], high = low;
  for (auto i = begin; i != end; ++i) {
    low = low.cwiseMin(centres[i->face]);
    high = high.cwiseMax(centres[i->face]);
  }
  int axis = 0;
  (high - low).maxCoeff(&axis);
  std::nth_element(begin, middle, end, [&](const Leaf& a, const Leaf& b) {
    return std::pair(centres[a.face][axis], a.face) < std::pair(centres[b.face][axis], b.face);
  });
  nodes_[node].first = static_cast<int>(nodes_.size());
  nodes_[node].count = 0;
  nodes_.push_back({box, first, count / 2});
  nodes_.push_back({box, first + count / 2, count - count / 2});
}

void TriangleTree::refit(const std::vector<Vector3d>& vertices) {
  if (static_cast<int>(vertices.size()) != num_vertices_)
    fail<UsageError>("distance to a surface: built for {} vertices, moved to {}", num_vertices_, vertices.size());
  double largest = 0.0;
  for (const Vector3d& v : vertices) {
    if (!v.allFinite())
      fail<UsageError>("distance to a surface: vertex {} is not finite; check how it was computed",
                       &v - vertices.data());
    largest = std::max(largest, v.cwiseAbs().maxCoeff());
  }
  for (Leaf& leaf : triangles_)
    for (int k = 0; k < 3; ++k) leaf.corners[k] = vertices[faces_[leaf.face][k]];
  const Vector3d padding = Vector3d::Constant(kPadding * largest);
  for (auto node = nodes_.rbegin(); node != nodes_.rend(); ++node) {  // children before parents
    Box& box = node->box;
    if (node->count == 0) {
      const Box &a = nodes_[node->first].box, &b = nodes_[node->first + 1].box;
      box = {a.low.cwiseMin(b.low), a.high.cwiseMax(b.high)};
      continue;
    }
    box.low = box.high = triangles_[node->first].corners[0];
    for (int i = node->first; i < node->first + node->count; ++i)
      for (const Vector3d& corner : triangles_[i].corners) {
        box.low = box.low.cwiseMin(corner);
        box.high = box.high.cwiseMax(corner);
      }
    box.low -= padding;
    box.high += padding;
  }
}

void TriangleTree::try_triangle(const Vector3d& point, const Leaf& leaf, Hit& best) const {
  const TrianglePoint found = closest_on_triangle(point, leaf.corners);
  if (found.squared_distance > best.squared_distance) return;
  if (found.squared_distance == best.squared_distance && leaf.face > best.face) return;
  static_cast<TrianglePoint&>(best) = found;
  best.face = leaf.face;
}

TriangleTree::Hit TriangleTree::closest(const Vector3d& point, int near_face) const {
  Hit best;
  if (near_face >= 0) try_triangle(point, triangles_[place_[near_face]], best);
  std::array<std::pair<double, int>, kMaxDepth> stack;
  int depth = 0;
  stack[0] = {nodes_[0].box.squared_distance(point), 0};
  while (depth >= 0) {
    const auto [distance, index] = stack[depth--];
    if (distance > best.squared_distance) continue;
    const Node& node = nodes_[index];
    for (int i = node.first; i < node.first + node.count; ++i) try_triangle(point, triangles_[i], best);
    if (node.count > 0) continue;
    std::pair<double, int> children[2];
    for (int k = 0; k < 2; ++k) children[k] = {nodes_[node.first + k].box.squared_distance(point), node.first + k};
    if (children[0].first < children[1].first) std::swap(children[0], children[1]);
    for (const auto& child : children)  // the nearer child is on top of the stack
      if (child.first <= best.squared_distance) stack[++depth] = child;
  }
  return best;
}

}  // namespace doppel
