#include "doppel/geometry/isosurface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core/utility.hpp>
#include <queue>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

/// Samples of the field at the corners of a grid.
struct Grid {
  GridLines lines;
  std::array<int, 3> size;  ///< corners along x, y, z
  std::vector<float> values;

  std::size_t index(int x, int y, int z) const { return (as_size(z) * size[1] + y) * size[0] + x; }
  Vector3d corner(int x, int y, int z) const {
    return {lines[0].planes[as_size(x)], lines[1].planes[as_size(y)], lines[2].planes[as_size(z)]};
  }
  /// The sides of the cell that begins at a corner.
  Vector3d cell(int x, int y, int z) const {
    return {lines[0].cells[as_size(x)], lines[1].cells[as_size(y)], lines[2].cells[as_size(z)]};
  }
};

constexpr int kBlock = 6;

/// Fills one block of corners. Far from the surface, the value at the centre of the block is used for all corners.
void sample_block(const DistanceField& field, Grid& grid, int bx, int by, int bz) {
  const std::array<int, 3> begin{bx * kBlock, by * kBlock, bz * kBlock};
  std::array<int, 3> end;
  for (int a = 0; a < 3; ++a) end[a] = std::min(begin[a] + kBlock, grid.size[a]);
  const Vector3d first = grid.corner(begin[0], begin[1], begin[2]),
                 last = grid.corner(end[0] - 1, end[1] - 1, end[2] - 1);
  const double at_middle = field(0.5 * (first + last));
  // Twice the half diagonal, because the field of an ellipsoid is not a true distance.
  const bool far = std::abs(at_middle) > (last - first).norm() * kBlock / (kBlock - 1);
  for (int z = begin[2]; z < end[2]; ++z)
    for (int y = begin[1]; y < end[1]; ++y)
      for (int x = begin[0]; x < end[0]; ++x)
        grid.values[grid.index(x, y, z)] = static_cast<float>(far ? at_middle : field(grid.corner(x, y, z)));
}

Grid sample(const DistanceField& field, const GridLines& lines) {
  Grid grid{lines, {}, {}};
  for (std::size_t a = 0; a < 3; ++a) grid.size[a] = static_cast<int>(lines[a].planes.size());
  grid.values.resize(grid.index(0, 0, grid.size[2]));
  std::array<int, 3> blocks;
  for (int a = 0; a < 3; ++a) blocks[a] = (grid.size[a] + kBlock - 1) / kBlock;
  cv::parallel_for_({0, blocks[2] * blocks[1]}, [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i)
      for (int bx = 0; bx < blocks[0]; ++bx) sample_block(field, grid, bx, i % blocks[1], i / blocks[1]);
  });
  return grid;
}

/// Whether the corners of a cell whose bit is set are connected along the cell's edges.
bool is_connected(unsigned corners) {
  if (corners == 0) return true;
  unsigned reached = corners & (~corners + 1);
  for (unsigned before = 0; before != reached;) {
    before = reached;
    for (int c = 0; c < 8; ++c)
      for (int axis = 0; axis < 3; ++axis)
        if (reached >> c & 1) reached |= corners & (1u << (c ^ (1 << axis)));
  }
  return reached == corners;
}

/// Fills corners where the surface would cross a cell twice, which would give a non-manifold vertex.
void make_unambiguous(Grid& grid) {
  for (bool changed = true; changed;) {
    changed = false;
    for (int z = 0; z + 1 < grid.size[2]; ++z)
      for (int y = 0; y + 1 < grid.size[1]; ++y)
        for (int x = 0; x + 1 < grid.size[0]; ++x) {
          unsigned inside = 0;
          std::size_t nearest = 0;
          float least = std::numeric_limits<float>::infinity();
          for (int c = 0; c < 8; ++c) {
            const std::size_t i = grid.index(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
            if (grid.values[i] < 0)
              inside |= 1u << c;
            else if (grid.values[i] < least)
              least = grid.values[i], nearest = i;
          }
          if (inside == 0 || inside == 255 || (is_connected(inside) && is_connected(~inside & 255u))) continue;
          // Filling only adds to the inside, so the loop terminates.
          grid.values[nearest] = static_cast<float>(-0.05 * grid.cell(x, y, z).minCoeff());
          changed = true;
        }
  }
}

/// The vertex of a cell: the mean of the crossings of its edges. False when the surface does not cross the cell.
bool cell_vertex(const Grid& grid, int x, int y, int z, Vector3d& vertex) {
  float value[8];
  int inside = 0;
  for (int c = 0; c < 8; ++c) {
    value[c] = grid.values[grid.index(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2))];
    inside += value[c] < 0;
  }
  if (inside == 0 || inside == 8) return false;
  Vector3d sum = Vector3d::Zero();
  int crossings = 0;
  for (int a = 0; a < 8; ++a)
    for (int axis = 0; axis < 3; ++axis) {
      const int b = a | (1 << axis);
      if (b == a || (value[a] < 0) == (value[b] < 0)) continue;
      Vector3d point(a & 1, a >> 1 & 1, a >> 2);
      point[axis] += value[a] / (value[a] - value[b]);
      sum += point;
      ++crossings;
    }
  vertex = grid.corner(x, y, z) + grid.cell(x, y, z).cwiseProduct(sum) / crossings;
  return true;
}

/// Two triangles for a quad a b c d, cut along the shorter diagonal.
void add_quad(TriangleMesh& mesh, int a, int b, int c, int d) {
  const auto& v = mesh.vertices;
  if ((v[a] - v[c]).squaredNorm() <= (v[b] - v[d]).squaredNorm()) {
    mesh.faces.push_back({a, b, c});
    mesh.faces.push_back({a, c, d});
  } else {
    mesh.faces.push_back({a, b, d});
    mesh.faces.push_back({b, c, d});
  }
}

TriangleMesh surface_nets(const Grid& grid) {
  TriangleMesh mesh;
  std::vector<int> vertex_of(grid.values.size(), -1);
  for (int z = 0; z + 1 < grid.size[2]; ++z)
    for (int y = 0; y + 1 < grid.size[1]; ++y)
      for (int x = 0; x + 1 < grid.size[0]; ++x) {
        Vector3d vertex;
        if (!cell_vertex(grid, x, y, z, vertex)) continue;
        vertex_of[grid.index(x, y, z)] = mesh.num_vertices();
        mesh.vertices.push_back(vertex);
      }
  for (int z = 1; z + 1 < grid.size[2]; ++z)
    for (int y = 1; y + 1 < grid.size[1]; ++y)
      for (int x = 1; x + 1 < grid.size[0]; ++x)
        for (int axis = 0; axis < 3; ++axis) {
          const std::array<int, 3> at{x, y, z};
          std::array<int, 3> next = at;
          ++next[axis];
          const bool here = grid.values[grid.index(x, y, z)] < 0;
          if (here == (grid.values[grid.index(next[0], next[1], next[2])] < 0)) continue;
          // The four cells around this grid edge, counter-clockwise seen from its far end.
          const int u = (axis + 1) % 3, v = (axis + 2) % 3;
          int corner[4];
          for (int k = 0; k < 4; ++k) {
            std::array<int, 3> c = at;
            c[u] -= k == 1 || k == 2 ? 0 : 1;
            c[v] -= k >= 2 ? 0 : 1;
            corner[k] = vertex_of[grid.index(c[0], c[1], c[2])];
          }
          if (here)
            add_quad(mesh, corner[0], corner[1], corner[2], corner[3]);
          else
            add_quad(mesh, corner[3], corner[2], corner[1], corner[0]);
        }
  return mesh;
}

Vector3d face_normal(const std::vector<Vector3d>& v, const Triangle& f) {
  return (v[f[1]] - v[f[0]]).cross(v[f[2]] - v[f[0]]);
}

/// A triangle mesh under edge collapse: faces by vertex, dead entries marked.
class Collapser {
 public:
  Collapser(const TriangleMesh& mesh, const DistanceField& field,
            const std::function<double(const Vector3d&)>& relative_size)
      : field_(field),
        relative_size_(relative_size),
        v_(mesh.vertices),
        f_(mesh.faces),
        faces_of_(v_.size()),
        stamp_(v_.size(), 0),
        alive_(mesh.num_vertices()) {
    for (int i = 0; i < mesh.num_faces(); ++i)
      for (const int v : f_[i]) faces_of_[v].push_back(i);
    for (std::size_t a = 0; a < v_.size(); ++a)
      for (const int b : neighbours(static_cast<int>(a)))
        if (static_cast<int>(a) < b) push(static_cast<int>(a), b);
  }

  void run(int target) {
    while (alive_ > target && !queue_.empty()) {
      const Edge edge = queue_.top();
      queue_.pop();
      if (stamp_[edge.a] == edge.stamp_a && stamp_[edge.b] == edge.stamp_b) try_collapse(edge.a, edge.b);
    }
  }

  TriangleMesh result() const {
    TriangleMesh mesh;
    std::vector<int> renumbered(v_.size(), -1);
    for (const Triangle& f : f_) {
      if (f[0] < 0) continue;
      Triangle face;
      for (int c = 0; c < 3; ++c) {
        int& to = renumbered[f[c]];
        if (to < 0) {
          to = mesh.num_vertices();
          mesh.vertices.push_back(v_[f[c]]);
        }
        face[c] = to;
      }
      mesh.faces.push_back(face);
    }
    return mesh;
  }

 private:
  struct Edge {
    double cost;
    int a, b, stamp_a, stamp_b;
    bool operator<(const Edge& other) const {
      if (cost != other.cost) return cost > other.cost;
      return a != other.a ? a > other.a : b > other.b;
    }
  };

  std::set<int> neighbours(int v) const {
    std::set<int> ring;
    for (const int f : faces_of_[v])
      for (const int w : f_[f])
        if (w != v) ring.insert(w);
    return ring;
  }

  void push(int a, int b) {
    const double size = relative_size_(0.5 * (v_[a] + v_[b]));
    queue_.push({(v_[a] - v_[b]).norm() / size, a, b, stamp_[a], stamp_[b]});
  }

  /// Whether the faces of `v`, except those with `other`, neither flip nor degenerate when `v` moves to `to`.
  bool keeps_shape(int v, int other, const Vector3d& to) const {
    for (const int i : faces_of_[v]) {
      const Triangle& f = f_[i];
      if (f[0] == other || f[1] == other || f[2] == other) continue;
      const Vector3d before = face_normal(v_, f);
      Vector3d p[3];
      for (int c = 0; c < 3; ++c) p[c] = f[c] == v ? to : v_[f[c]];
      const Vector3d after = (p[1] - p[0]).cross(p[2] - p[0]);
      const double longest =
          std::max({(p[1] - p[0]).squaredNorm(), (p[2] - p[1]).squaredNorm(), (p[0] - p[2]).squaredNorm()});
      if (after.dot(before) < 0.5 * after.norm() * before.norm() || after.norm() < 0.25 * longest) return false;
    }
    return true;
  }

  void try_collapse(int a, int b) {
    const std::set<int> ring_a = neighbours(a), ring_b = neighbours(b);
    std::vector<int> common;
    std::set_intersection(ring_a.begin(), ring_a.end(), ring_b.begin(), ring_b.end(), std::back_inserter(common));
    // The link condition: without exactly two common neighbours the result is not a manifold.
    if (common.size() != 2 || ring_a.size() + ring_b.size() > 13) return;
    for (const int c : common)
      if (neighbours(c).size() <= 4) return;
    const Vector3d to = project_to_field(field_, 0.5 * (v_[a] + v_[b]));
    if (!keeps_shape(a, b, to) || !keeps_shape(b, a, to)) return;
    v_[a] = to;
    for (const int i : faces_of_[b]) {
      Triangle& f = f_[i];
      if (f[0] == a || f[1] == a || f[2] == a) {
        for (const int v : f)
          if (v != b) faces_of_[v].erase(std::find(faces_of_[v].begin(), faces_of_[v].end(), i));
        f = {-1, -1, -1};
      } else {
        std::replace(f.begin(), f.end(), b, a);
        faces_of_[a].push_back(i);
      }
    }
    faces_of_[b].clear();
    ++stamp_[a];
    ++stamp_[b];
    --alive_;
    for (const int c : neighbours(a)) push(std::min(a, c), std::max(a, c));
  }

  const DistanceField& field_;
  const std::function<double(const Vector3d&)>& relative_size_;
  std::vector<Vector3d> v_;
  std::vector<Triangle> f_;
  std::vector<std::vector<int>> faces_of_;
  std::vector<int> stamp_;
  std::priority_queue<Edge> queue_;
  int alive_;
};

/// Moves every vertex towards the mean of its neighbours and projects it onto the surface, unless a face would flip.
void relax(TriangleMesh& mesh, const DistanceField& field, int rounds) {
  const MeshTopology topology(mesh);
  std::vector<std::vector<int>> faces_of(mesh.num_vertices());
  for (int i = 0; i < mesh.num_faces(); ++i)
    for (const int v : mesh.faces[i]) faces_of[v].push_back(i);
  for (int round = 0; round < rounds; ++round)
    for (int v = 0; v < mesh.num_vertices(); ++v) {
      const IndexRows& ring = topology.one_ring();
      Vector3d mean = Vector3d::Zero();
      for (const int w : ring.row(v)) mean += mesh.vertices[w] / ring.size(v);
      const Vector3d old = mesh.vertices[v];
      std::vector<Vector3d> before;
      for (const int f : faces_of[v]) before.push_back(face_normal(mesh.vertices, mesh.faces[f]));
      mesh.vertices[v] = project_to_field(field, old + 0.5 * (mean - old));
      bool turned = false;
      for (std::size_t k = 0; k < before.size(); ++k) {
        const Vector3d after = face_normal(mesh.vertices, mesh.faces[faces_of[v][k]]);
        turned = turned || after.dot(before[k]) < 0.7 * after.norm() * before[k].norm();
      }
      if (turned) mesh.vertices[v] = old;
    }
}

}  // namespace

GridLines regular_lines(const Vector3d& low, const Vector3d& high, double cell) {
  GridLines lines;
  for (int a = 0; a < 3; ++a) {
    GridLine& line = lines[as_size(a)];
    const int count = static_cast<int>(std::ceil((high[a] - low[a]) / cell)) + 2;
    for (int i = 0; i < count; ++i) line.planes.push_back(low[a] + cell * i);
    line.cells.assign(as_size(count), cell);
  }
  return lines;
}

void refine_lines(GridLines& lines, const Vector3d& low, const Vector3d& high, double cell) {
  if (!(cell > 0.0) || !((high - low).minCoeff() > 0.0))
    fail("refining a grid: a cell of {} m and a box of {} x {} x {} m; all must be above 0", cell, high.x() - low.x(),
         high.y() - low.y(), high.z() - low.z());
  for (int a = 0; a < 3; ++a) {
    std::vector<double>& planes = lines[as_size(a)].planes;
    const auto first = std::lower_bound(planes.begin(), planes.end(), low[a]);
    const auto last = std::upper_bound(first, planes.end(), high[a]);
    std::vector<double> refined(planes.begin(), first);
    const int count = static_cast<int>(std::ceil((high[a] - low[a]) / cell));
    for (int i = 0; i <= count; ++i) refined.push_back(low[a] + (high[a] - low[a]) * i / count);
    refined.insert(refined.end(), last, planes.end());
    planes = std::move(refined);
    std::vector<double>& cells = lines[as_size(a)].cells;
    cells.assign(planes.size(), 0.0);
    for (std::size_t i = 0; i + 1 < planes.size(); ++i) cells[i] = planes[i + 1] - planes[i];
  }
}

TriangleMesh mesh_field(const DistanceField& field, const Vector3d& low, const Vector3d& high, double cell) {
  return mesh_field(field, regular_lines(low, high, cell));
}

TriangleMesh mesh_field(const DistanceField& field, const GridLines& lines) {
  Grid grid = sample(field, lines);
  make_unambiguous(grid);
  TriangleMesh mesh = surface_nets(grid);
  const MeshReport report = inspect_mesh(mesh);
  if (!report.closed() || report.components != 1 || report.euler_characteristic != 2)
    fail(
        "meshing a distance field: a grid of {} x {} x {} corners gives {} components and Euler characteristic {}, but "
        "one closed surface without holes is needed; use a finer grid",
        grid.size[0], grid.size[1], grid.size[2], report.components, report.euler_characteristic);
  for (Vector3d& v : mesh.vertices) v = project_to_field(field, v);
  return mesh;
}

TriangleMesh coarsen(const TriangleMesh& mesh, const DistanceField& field, int target_vertices,
                     const std::function<double(const Vector3d&)>& relative_size) {
  Collapser collapser(mesh, field, relative_size);
  collapser.run(target_vertices);
  TriangleMesh result = collapser.result();
  relax(result, field, 3);
  return result;
}

}  // namespace doppel
