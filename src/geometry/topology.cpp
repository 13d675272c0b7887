#include "doppel/geometry/topology.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <queue>
#include <unordered_map>
#include <unordered_set>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

using Edge = std::array<int, 2>;

// A triangle thinner than this (area over longest edge squared) has no usable normal.
constexpr double kDegenerateShape = 1e-10;

Edge ordered(int a, int b) { return a < b ? Edge{a, b} : Edge{b, a}; }

void check_faces(const TriangleMesh& mesh) {
  for (const Triangle& face : mesh.faces) {
    for (int vertex : face) {
      if (vertex < 0 || vertex >= mesh.num_vertices()) {
        fail("building a mesh topology: a face names vertex {}, the mesh has {}", vertex, mesh.num_vertices());
      }
    }
  }
}

std::vector<Edge> directed_edges(const TriangleMesh& mesh) {
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.faces.size());
  for (const Triangle& face : mesh.faces) {
    for (int corner = 0; corner < 3; ++corner) {
      const Edge edge{face[corner], face[(corner + 1) % 3]};
      if (edge[0] != edge[1]) edges.push_back(edge);
    }
  }
  return edges;
}

bool is_degenerate(const TriangleMesh& mesh, const Triangle& face) {
  const Eigen::Vector3d &a = mesh.vertices[face[0]], &b = mesh.vertices[face[1]], &c = mesh.vertices[face[2]];
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return (b - a).cross(c - a).norm() <= 2 * kDegenerateShape * longest;
}

}  // namespace

MeshTopology::MeshTopology(const TriangleMesh& mesh) {
  check_faces(mesh);
  edges_ = directed_edges(mesh);
  build_rows(mesh.num_vertices());
}

MeshTopology::MeshTopology(int num_vertices, const std::vector<Edge>& edges) : edges_(edges) {
  for (const Edge& edge : edges_) {
    if (std::min(edge[0], edge[1]) < 0 || std::max(edge[0], edge[1]) >= num_vertices || edge[0] == edge[1]) {
      fail("building a topology: the edge {}-{} is invalid for {} vertices", edge[0], edge[1], num_vertices);
    }
  }
  build_rows(num_vertices);
}

void MeshTopology::build_rows(int num_vertices) {
  for (Edge& edge : edges_) edge = ordered(edge[0], edge[1]);
  std::sort(edges_.begin(), edges_.end());
  edges_.erase(std::unique(edges_.begin(), edges_.end()), edges_.end());

  one_ring_.offsets.assign(as_size(num_vertices) + 1, 0);
  for (const Edge& edge : edges_) {
    ++one_ring_.offsets[edge[0] + 1];
    ++one_ring_.offsets[edge[1] + 1];
  }
  for (int v = 0; v < num_vertices; ++v) one_ring_.offsets[v + 1] += one_ring_.offsets[v];
  one_ring_.items.resize(2 * edges_.size());
  // In the order of the edges every vertex first gets its smaller neighbours, then its larger ones: rows ascend.
  std::vector<int> next(one_ring_.offsets.begin(), one_ring_.offsets.end() - 1);
  for (const Edge& edge : edges_) one_ring_.items[next[edge[1]]++] = edge[0];
  for (const Edge& edge : edges_) one_ring_.items[next[edge[0]]++] = edge[1];
}

std::vector<int> MeshTopology::components() const {
  std::vector<int> component(num_vertices(), -1);
  std::vector<int> stack;
  int count = 0;
  for (int seed = 0; seed < num_vertices(); ++seed) {
    if (component[seed] >= 0) continue;
    component[seed] = count;
    stack.push_back(seed);
    while (!stack.empty()) {
      const int vertex = stack.back();
      stack.pop_back();
      for (const int n : one_ring_.row(vertex)) {
        if (component[n] >= 0) continue;
        component[n] = count;
        stack.push_back(n);
      }
    }
    ++count;
  }
  return component;
}

std::vector<std::pair<int, int>> MeshTopology::ball(int source, int max_hops) const {
  std::vector<std::pair<int, int>> reached{{source, 0}};
  std::unordered_set<int> seen{source};
  std::size_t begin = 0;
  for (int hops = 1; hops <= max_hops && begin < reached.size(); ++hops) {
    const std::size_t end = reached.size();
    for (; begin < end; ++begin) {
      const int vertex = reached[begin].first;
      for (const int n : one_ring_.row(vertex)) {
        if (seen.insert(n).second) reached.emplace_back(n, hops);
      }
    }
    std::sort(reached.begin() + static_cast<std::ptrdiff_t>(end), reached.end());
  }
  return reached;
}

std::vector<std::pair<int, double>> MeshTopology::geodesic_ball(int source, double max_length,
                                                                const std::vector<Eigen::Vector3d>& positions) const {
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  std::unordered_map<int, double> best{{source, 0.0}};
  std::vector<std::pair<int, double>> reached;
  queue.emplace(0.0, source);
  while (!queue.empty()) {
    const auto [length, vertex] = queue.top();
    queue.pop();
    if (length > best[vertex]) continue;
    reached.emplace_back(vertex, length);
    for (const int n : one_ring_.row(vertex)) {
      const double longer = length + (positions[n] - positions[vertex]).norm();
      if (longer > max_length) continue;
      const auto [known, fresh] = best.emplace(n, longer);
      if (!fresh && known->second <= longer) continue;
      known->second = longer;
      queue.emplace(longer, n);
    }
  }
  return reached;
}

IndexRows face_neighbours(const std::vector<Triangle>& faces) {
  std::vector<std::pair<Edge, int>> sides;  // undirected edge and face
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k)
      if (const int a = faces[f][k], b = faces[f][(k + 1) % 3]; a != b)
        sides.emplace_back(ordered(a, b), static_cast<int>(f));
  std::sort(sides.begin(), sides.end());
  std::vector<std::vector<int>> found(faces.size());
  for (std::size_t first = 0, last = 0; first < sides.size(); first = last) {
    while (last < sides.size() && sides[last].first == sides[first].first) ++last;
    for (std::size_t i = first; i < last; ++i)
      for (std::size_t j = first; j < last; ++j)
        if (sides[i].second != sides[j].second) found[sides[i].second].push_back(sides[j].second);
  }
  IndexRows rows;
  for (std::vector<int>& row : found) {
    std::sort(row.begin(), row.end());
    rows.items.insert(rows.items.end(), row.begin(), std::unique(row.begin(), row.end()));
    rows.offsets.push_back(static_cast<int>(rows.items.size()));
  }
  return rows;
}

MeshReport inspect_mesh(const TriangleMesh& mesh) {
  MeshReport report;
  const MeshTopology topology(mesh);
  std::vector<Edge> directed = directed_edges(mesh);

  // After sorting by undirected edge, all uses of an edge are consecutive.
  std::sort(directed.begin(), directed.end(), [](const Edge& a, const Edge& b) {
    return std::make_pair(ordered(a[0], a[1]), a) < std::make_pair(ordered(b[0], b[1]), b);
  });
  for (std::size_t i = 0; i < directed.size();) {
    const Edge edge = ordered(directed[i][0], directed[i][1]);
    std::size_t forward = 0, uses = 0;
    for (; i < directed.size() && ordered(directed[i][0], directed[i][1]) == edge; ++i, ++uses)
      forward += directed[i] == edge;
    if (uses == 1) ++report.boundary_edges;
    if (uses > 2 || (uses == 2 && forward != 1)) ++report.non_manifold_edges;
  }

  const std::vector<int> component = topology.components();
  std::unordered_set<int> components;
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    if (topology.one_ring().size(v) == 0) {
      ++report.isolated_vertices;
    } else {
      components.insert(component[v]);
    }
  }
  report.components = static_cast<int>(components.size());
  for (const Triangle& face : mesh.faces) report.degenerate_faces += is_degenerate(mesh, face);
  report.euler_characteristic =
      mesh.num_vertices() - report.isolated_vertices - static_cast<int>(topology.edges().size()) + mesh.num_faces();
  return report;
}

}  // namespace doppel
