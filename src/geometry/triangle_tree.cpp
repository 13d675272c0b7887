#include "doppel/geometry/triangle_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

/// A node has up to 8 times as many triangles as a child, so no tree of int-indexed triangles has more levels.
constexpr int kMaxLevels = 12;
/// Margin of the boxes, relative to the largest coordinate, so that rounding cannot put a triangle outside its box.
constexpr double kPadding = 1e-14;
/// Relative margin for the rounding of squared distances in the kernel.
constexpr double kRelativeMargin = 1e-9;

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

TriangleTree::TriangleTree(const std::vector<Vector3d>& vertices, const std::vector<Triangle>& faces)
    : num_vertices_(static_cast<int>(vertices.size())), faces_(faces), slot_(faces.size()) {
  check_faces(vertices.size(), faces);
  std::vector<Vector3d> centres;
  for (const Triangle& f : faces) centres.emplace_back(vertices[f[0]] + vertices[f[1]] + vertices[f[2]]);
  // Checked before any comparison sorts by them.
  for (const Vector3d& centre : centres)
    if (!centre.allFinite()) fail<UsageError>("distance to a surface: a vertex of a face is not finite");
  std::vector<int> order(faces.size());
  std::iota(order.begin(), order.end(), 0);
  add_node(order, {0, num_faces()}, centres);
  refit(vertices);
}

namespace {

/// Halves a range of triangles at the median along its longest axis.
void halve(std::vector<int>& order, int first, int count, const std::vector<Vector3d>& centres) {
  const auto begin = order.begin() + first, middle = begin + count / 2, end = begin + count;
  Vector3d low = centres[*begin], high = low;
  for (auto i = begin; i != end; ++i) {
    low = low.cwiseMin(centres[*i]);
    high = high.cwiseMax(centres[*i]);
  }
  int axis = 0;
  (high - low).maxCoeff(&axis);
  std::nth_element(begin, middle, end,
                   [&](int a, int b) { return std::pair(centres[a][axis], a) < std::pair(centres[b][axis], b); });
}

}  // namespace

int TriangleTree::add_node(std::vector<int>& order, Range range, const std::vector<Vector3d>& centres) {
  std::vector<Range> parts{range};
  while (static_cast<int>(parts.size()) < kTreeWidth) {
    const auto largest =
        std::max_element(parts.begin(), parts.end(), [](const Range& a, const Range& b) { return a.count < b.count; });
    if (largest->count <= kTreeWidth) break;
    const Range whole = *largest;
    halve(order, whole.first, whole.count, centres);
    *largest = {whole.first, whole.count / 2};
    parts.push_back({whole.first + whole.count / 2, whole.count - whole.count / 2});
  }
  const auto index = nodes_.size();
  nodes_.emplace_back();
  for (int lane = 0; lane < kTreeWidth; ++lane) {
    int child = 0;  // of an unused lane: its box is never near
    if (lane < static_cast<int>(parts.size())) {
      const Range& part = parts[lane];
      child = part.count <= kTreeWidth ? ~add_leaf(order, part) : add_node(order, part, centres);
    }
    nodes_[index].child[lane] = child;
    for (int axis = 0; axis < 3; ++axis) {
      nodes_[index].low[axis][lane] = std::numeric_limits<double>::infinity();
      nodes_[index].high[axis][lane] = -std::numeric_limits<double>::infinity();
    }
  }
  return static_cast<int>(index);
}

int TriangleTree::add_leaf(const std::vector<int>& order, Range range) {
  const auto index = static_cast<int>(leaves_.size());
  TreeLeaf leaf{};
  for (int lane = 0; lane < kTreeWidth; ++lane) {
    const bool used = lane < range.count;
    leaf.face[lane] = order[range.first + (used ? lane : 0)];
    if (used) slot_[leaf.face[lane]] = index * kTreeWidth + lane;
  }
  leaves_.push_back(leaf);
  return index;
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
  margin_ = kPadding * largest * largest;
  for (TreeLeaf& leaf : leaves_)
    for (int lane = 0; lane < kTreeWidth; ++lane)
      for (int k = 0; k < 3; ++k)
        for (int axis = 0; axis < 3; ++axis) leaf.corner[k][axis][lane] = vertices[faces_[leaf.face[lane]][k]][axis];
  const double padding = kPadding * largest;
  for (auto node = nodes_.rbegin(); node != nodes_.rend(); ++node)  // children before parents
    for (int lane = 0; lane < kTreeWidth; ++lane) {
      const std::int32_t child = node->child[lane];
      if (child == 0) continue;  // unused: the root is no child
      for (int axis = 0; axis < 3; ++axis) {
        double low = std::numeric_limits<double>::infinity(), high = -low;
        if (child < 0) {
          for (int k = 0; k < 3; ++k) {
            const double* corners = leaves_[~child].corner[k][axis];
            low = std::min(low, *std::min_element(corners, corners + kTreeWidth) - padding);
            high = std::max(high, *std::max_element(corners, corners + kTreeWidth) + padding);
          }
        } else {
          const TreeNode& below = nodes_[child];
          low = *std::min_element(below.low[axis], below.low[axis] + kTreeWidth);
          high = *std::max_element(below.high[axis], below.high[axis] + kTreeWidth);
        }
        node->low[axis][lane] = low;
        node->high[axis][lane] = high;
      }
    }
}

void TriangleTree::try_triangle(const Vector3d& point, const TreeLeaf& leaf, int lane, Hit& best) const {
  std::array<Vector3d, 3> corners;
  for (std::size_t k = 0; k < 3; ++k)
    corners[k] = {leaf.corner[k][0][lane], leaf.corner[k][1][lane], leaf.corner[k][2][lane]};
  const TrianglePoint found = closest_on_triangle(point, corners);
  if (found.squared_distance > best.squared_distance) return;
  if (found.squared_distance == best.squared_distance && leaf.face[lane] > best.face) return;
  static_cast<TrianglePoint&>(best) = found;
  best.face = leaf.face[lane];
}

TriangleTree::Hit TriangleTree::closest(const Vector3d& point, int near_face) const {
  Hit best;
  if (near_face >= 0) {
    const int slot = slot_[near_face];
    try_triangle(point, leaves_[slot / kTreeWidth], slot % kTreeWidth, best);
  }
  // The nearest on top. A level adds at most all children but the one that is followed.
  std::array<std::pair<double, std::int32_t>, kMaxLevels * kTreeWidth> stack;
  int size = 0;
  stack[size++] = {0.0, 0};
  while (size > 0) {
    const auto [distance, child] = stack[--size];
    if (distance > best.squared_distance) continue;
    if (child < 0) {
      const TreeLeaf& leaf = leaves_[~child];
      const double bound = best.squared_distance * (1.0 + kRelativeMargin) + margin_;
      for (unsigned lanes = kernels::near_triangles(leaf, point.data(), bound); lanes != 0; lanes &= lanes - 1)
        try_triangle(point, leaf, std::countr_zero(lanes), best);
      continue;
    }
    double distances[kTreeWidth];
    const TreeNode& node = nodes_[child];
    const int bottom = size;
    for (unsigned lanes = kernels::near_children(node, point.data(), best.squared_distance, distances); lanes != 0;
         lanes &= lanes - 1) {
      const int lane = std::countr_zero(lanes);
      int at = size++;
      for (; at > bottom && stack[at - 1].first < distances[lane]; --at) stack[at] = stack[at - 1];
      stack[at] = {distances[lane], node.child[lane]};
    }
  }
  return best;
}

}  // namespace doppel
