#include "doppel/rigging/weights/solid_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <unordered_map>

#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"

namespace doppel {
namespace {

/// The share of the solid around each point of a grid of twice the cell size, minus one half: positive inside.
struct CoarseField {
  explicit CoarseField(const SolidGrid& solid) : spacing(2 * solid.cell) {
    for (std::size_t axis = 0; axis < 3; ++axis) size[axis] = solid.size[axis] / 2 + 4;
    // Point (i, j, k) lies in the middle of the 2 x 2 x 2 cells from 2i - 3 on; weights 1 3 3 1 along each axis.
    origin = solid.origin + Eigen::Vector3d::Constant(-2.5 * solid.cell);
    constexpr std::array<float, 4> kWeight{0.125f, 0.375f, 0.375f, 0.125f};
    for (int k = 0; k < size[2]; ++k)
      for (int j = 0; j < size[1]; ++j)
        for (int i = 0; i < size[0]; ++i) {
          float share = 0;
          for (int c = 0; c < 64; ++c) {
            const int x = c & 3, y = c >> 2 & 3, z = c >> 4;
            if (solid.is_inside(2 * i - 4 + x, 2 * j - 4 + y, 2 * k - 4 + z))
              share += kWeight[x] * kWeight[y] * kWeight[z];
          }
          // Not exactly 0, so that no vertex of the surface is a point of the grid.
          value.push_back(share - 0.4993f);
        }
  }
  int index(int i, int j, int k) const { return i + size[0] * (j + size[1] * k); }
  Eigen::Vector3d point(int index) const {
    return origin + spacing * Eigen::Vector3d(index % size[0], index / size[0] % size[1], index / (size[0] * size[1]));
  }

  double spacing;
  std::array<int, 3> size{};
  Eigen::Vector3d origin;
  std::vector<float> value;
};

class Tetrahedra {
 public:
  explicit Tetrahedra(const CoarseField& field) : field_(field) {}

  TriangleMesh march() {
    // The six tetrahedra of a cube around its diagonal from corner 0 to corner 7 (Kuhn). They fit those of the
    // neighbouring cubes.
    constexpr std::array<std::array<int, 4>, 6> kSplit{
        {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};
    for (int k = 0; k + 1 < field_.size[2]; ++k)
      for (int j = 0; j + 1 < field_.size[1]; ++j)
        for (int i = 0; i + 1 < field_.size[0]; ++i) {
          std::array<int, 8> corner{};
          int count = 0;
          for (int c = 0; c < 8; ++c) {
            corner[c] = field_.index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
            if (inside(corner[c])) ++count;
          }
          if (count == 0 || count == 8) continue;
          for (const auto& t : kSplit) cut({corner[t[0]], corner[t[1]], corner[t[2]], corner[t[3]]});
        }
    return std::move(mesh_);
  }

 private:
  bool inside(int point) const { return field_.value[point] > 0; }

  /// The vertex on the edge between a point inside and a point outside.
  int vertex(int a, int b) {
    if (a > b) std::swap(a, b);
    const auto key = (static_cast<std::uint64_t>(a) << 32) | static_cast<std::uint64_t>(b);
    const auto [found, added] = vertices_.emplace(key, mesh_.num_vertices());
    if (added) {
      const double va = field_.value[a], vb = field_.value[b];
      mesh_.vertices.push_back(field_.point(a) + va / (va - vb) * (field_.point(b) - field_.point(a)));
    }
    return found->second;
  }

  void face(int a, int b, int c, const Eigen::Vector3d& outward) {
    const auto& v = mesh_.vertices;
    const Eigen::Vector3d normal = (v[b] - v[a]).cross(v[c] - v[a]);
    mesh_.faces.push_back(normal.dot(outward) > 0 ? Triangle{a, b, c} : Triangle{a, c, b});
  }

  void cut(const std::array<int, 4>& corners) {
    std::vector<int> in, out;
    for (const int c : corners) (inside(c) ? in : out).push_back(c);
    if (in.empty() || out.empty()) return;
    Eigen::Vector3d outward = Eigen::Vector3d::Zero();
    for (const int c : out) outward += field_.point(c) / static_cast<double>(out.size());
    for (const int c : in) outward -= field_.point(c) / static_cast<double>(in.size());
    if (in.size() == 2) {
      const int a = vertex(in[0], out[0]), b = vertex(in[0], out[1]), c = vertex(in[1], out[1]),
                d = vertex(in[1], out[0]);
      face(a, b, c, outward);
      face(a, c, d, outward);
    } else {
      const bool one_in = in.size() == 1;
      const int tip = one_in ? in[0] : out[0];
      const std::vector<int>& base = one_in ? out : in;
      face(vertex(tip, base[0]), vertex(tip, base[1]), vertex(tip, base[2]), outward);
    }
  }

  const CoarseField& field_;
  TriangleMesh mesh_;
  std::unordered_map<std::uint64_t, int> vertices_;
};

/// Removes the small parts.
TriangleMesh large_parts(const TriangleMesh& mesh) {
  const std::vector<int> part = MeshTopology(mesh).components();
  std::map<int, int> count;
  for (const int p : part) ++count[p];
  int largest = 0;
  for (const auto& entry : count) largest = std::max(largest, entry.second);
  TriangleMesh kept;
  std::vector<int> number(part.size(), -1);
  for (std::size_t v = 0; v < part.size(); ++v) {
    if (20 * count[part[v]] < largest) continue;
    number[v] = kept.num_vertices();
    kept.vertices.push_back(mesh.vertices[v]);
  }
  for (const Triangle& f : mesh.faces)
    if (number[f[0]] >= 0) kept.faces.push_back({number[f[0]], number[f[1]], number[f[2]]});
  return kept;
}

}  // namespace

TriangleMesh solid_surface(const SolidGrid& solid) {
  const CoarseField field(solid);
  const TriangleMesh mesh = Tetrahedra(field).march();
  if (mesh.faces.empty())
    fail("the surface of a solid: the solid is empty, or thinner than three cells of {} m", solid.cell);
  return large_parts(mesh);
}

}  // namespace doppel
