#include "doppel/rigging/scan/repair.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <set>
#include <unordered_map>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/statistics.h"
#include "doppel/geometry/triangle_tree.h"
#include "doppel/rigging/scan/edge_table.h"
#include "doppel/rigging/scan/floor.h"
#include "doppel/rigging/scan/hole_filling.h"
#include "doppel/rigging/scan/scan_parts.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kNamed = 5;       // how many lost vertices the report names
constexpr double kNoArea = 1e-12;       // of the squared height: a face without area
constexpr double kOneSurface = 0.9;     // share of the area of the largest component in a scan of one surface
constexpr double kLidShare = 0.25;      // a lid larger than this share of its component would close a sheet
constexpr double kClearVolume = 0.005;  // |volume| over area^1.5 that tells inside from outside; a sphere has 0.094
// A tiny body of so few faces must touch to belong to the person; with fewer it is a sheet, such as a strand of hair.
constexpr int kMinClosedFaces = 4, kFewFaces = 12;
constexpr double kTouching = 0.15;           // of the distance that is allowed to others
constexpr int kSpeckSamples = 2000;          // faces of a component that are looked at
constexpr int kSpeckRounds = 6;              // chains of small parts that hang on each other
constexpr double kSeparateFloorShare = 0.6;  // a floor of this share in parts of its own is no part of the body
constexpr double kNoSpeck = 0.02;            // share of the largest component's area beyond which none is a speck
constexpr int kBorder = -1;

double face_area(const TriangleMesh& mesh, const Triangle& face) {
  const Vector3d& a = mesh.vertices[face[0]];
  return 0.5 * (mesh.vertices[face[1]] - a).cross(mesh.vertices[face[2]] - a).norm();
}

/// Points by cells of a grid, to find those within half a cell's edge of each other.
class PointGrid {
 public:
  explicit PointGrid(double reach) : cell_(2.0 * reach), squared_reach_(reach * reach) {}

  /// A point stored before within reach; else stores this one and returns it.
  int find_or_add(const std::vector<Vector3d>& points, int point) {
    const Vector3d& p = points[point];
    const Eigen::Array3d position = p.array() / cell_;
    const Eigen::Array3d low = (position - 0.5).floor();
    for (int k = 0; k < 8; ++k) {
      const auto found = cells_.find(key(low + Eigen::Array3d(k & 1, k >> 1 & 1, k >> 2 & 1)));
      if (found == cells_.end()) continue;
      for (const int other : found->second)
        if ((points[other] - p).squaredNorm() <= squared_reach_) return other;
    }
    cells_[key(position.floor())].push_back(point);
    return point;
  }

 private:
  static std::uint64_t key(const Eigen::Array3d& cell) {
    std::uint64_t value = 0;
    for (int k = 0; k < 3; ++k)
      value = value * 0x9E3779B97F4A7C15ull + static_cast<std::uint64_t>(static_cast<std::int64_t>(cell[k]));
    return value;
  }

  double cell_, squared_reach_;
  std::unordered_map<std::uint64_t, std::vector<int>> cells_;
};

class ScanRepair {
 public:
  ScanRepair(const TriangleMesh& mesh, const RepairOptions& options) : mesh_(mesh), options_(options) {
    check_scan_mesh(mesh, "repairing the scan");
  }

  RepairedMesh run() {
    lose_vertices();
    measure_height();
    weld();
    drop_faces();
    if (options_.remove_floor) remove_floor();
    remove_specks();
    pair_edges();
    wind_alike();
    split_vertices();
    fill_holes();
    compact();
    int count = 0;
    face_components(mesh_.faces, mesh_.vertices.size(), count);
    report_.components = count;
    return {std::move(mesh_), std::move(report_)};
  }

 private:
  /// @return how many faces were dropped
  int keep_faces(const std::vector<bool>& keep) {
    std::size_t kept = 0;
    for (std::size_t f = 0; f < keep.size(); ++f) {
      if (!keep[f]) continue;
      mesh_.faces[kept] = mesh_.faces[f];
      if (!mesh_.face_uvs.empty()) mesh_.face_uvs[kept] = mesh_.face_uvs[f];
      ++kept;
    }
    const int dropped = static_cast<int>(keep.size() - kept);
    mesh_.faces.resize(kept);
    if (!mesh_.face_uvs.empty()) mesh_.face_uvs.resize(kept);
    if (kept == 0) fail<UsageError>("repairing the scan: of {} triangles none is left; check the file", keep.size());
    return dropped;
  }

  void lose_vertices() {
    for (std::size_t v = 0; v < mesh_.vertices.size(); ++v) {
      if (mesh_.vertices[v].allFinite()) continue;
      ++report_.lost_vertices;
      if (report_.lost_named.size() < kNamed) report_.lost_named.push_back(static_cast<int>(v));
    }
    if (report_.lost_vertices == 0) return;
    std::vector<bool> keep(mesh_.faces.size(), true);
    for (std::size_t f = 0; f < keep.size(); ++f)
      for (const int v : mesh_.faces[f]) keep[f] = keep[f] && mesh_.vertices[v].allFinite();
    report_.lost_faces = keep_faces(keep);
  }

  /// Specks far away must not change it, so a few vertices at either end do not count.
  void measure_height() {
    std::vector<double> heights;
    heights.reserve(mesh_.faces.size());
    for (const Triangle& face : mesh_.faces) heights.push_back(mesh_.vertices[face[0]].y());
    const double low = quantile(heights, 0.002), high = quantile(std::move(heights), 0.998);
    height_ = high - low;
    for (const Triangle& face : mesh_.faces)
      if (height_ <= 0.0) height_ = std::sqrt(face_area(mesh_, face));
    if (!(height_ > 0.0)) fail<UsageError>("repairing the scan: all triangles lie in one point; check the file");
  }

  /// Only vertices on borders are welded: a surface that touches another one stays by itself.
  void weld() {
    std::vector<bool> border(mesh_.vertices.size(), false);
    for_each_edge(sorted_edge_uses(mesh_.faces), [&](const EdgeUse* first, const EdgeUse* last) {
      if (last - first == 1) border[first->low] = border[first->high] = true;
    });
    PointGrid grid(options_.weld_distance * height_);
    std::vector<int> target(mesh_.vertices.size());
    std::iota(target.begin(), target.end(), 0);
    for (std::size_t v = 0; v < target.size(); ++v) {
      if (!border[v]) continue;
      target[v] = grid.find_or_add(mesh_.vertices, static_cast<int>(v));
      report_.welded_vertices += target[v] != static_cast<int>(v);
    }
    if (report_.welded_vertices == 0) return;
    for (Triangle& face : mesh_.faces)
      for (int& v : face) v = target[v];
  }

  void drop_faces() {
    std::vector<bool> keep(mesh_.faces.size(), true);
    for (std::size_t f = 0; f < keep.size(); ++f) {
      const auto& [a, b, c] = mesh_.faces[f];
      keep[f] = a != b && b != c && c != a && face_area(mesh_, mesh_.faces[f]) > kNoArea * height_ * height_;
    }
    report_.degenerate_faces = keep_faces(keep);
    std::vector<std::pair<Triangle, int>> sorted(mesh_.faces.size());
    for (std::size_t f = 0; f < sorted.size(); ++f) {
      sorted[f] = {mesh_.faces[f], static_cast<int>(f)};
      std::sort(sorted[f].first.begin(), sorted[f].first.end());
    }
    std::sort(sorted.begin(), sorted.end());
    keep.assign(sorted.size(), true);
    for (std::size_t i = 1; i < sorted.size(); ++i)
      if (sorted[i].first == sorted[i - 1].first) keep[sorted[i].second] = false;
    report_.duplicate_faces = keep_faces(keep);
  }

  void remove_floor() {
    // Specks below the floor must not hide it: only components of some size count.
    int count = 0;
    const std::vector<int> component = face_components(mesh_.faces, mesh_.vertices.size(), count);
    const std::vector<double> areas = component_areas(component, count);
    const double largest = *std::max_element(areas.begin(), areas.end());
    Eigen::AlignedBox3d box;
    for (std::size_t f = 0; f < component.size(); ++f)
      if (areas[component[f]] > kNoSpeck * largest)
        for (const int v : mesh_.faces[f]) box.extend(mesh_.vertices[v]);
    const std::optional<FloorSheet> sheet =
        find_floor(mesh_, Vector3d::UnitY(), box.min().y(), box.max().y(), box.sizes().maxCoeff());
    if (!sheet) return;
    // A sheet in components of its own goes as a whole, and the soles stay; a fused one is cut out.
    std::vector<bool> flat(count, true);
    for (std::size_t f = 0; f < component.size(); ++f)
      for (const int v : mesh_.faces[f])
        if (std::abs(mesh_.vertices[v].y() - sheet->level) > 2.0 * sheet->thickness) flat[component[f]] = false;
    double separate = 0.0;
    for (const int f : sheet->faces)
      if (flat[component[f]]) separate += face_area(mesh_, mesh_.faces[f]);
    std::vector<bool> keep(mesh_.faces.size(), true);
    if (separate > kSeparateFloorShare * sheet->area) {
      for (std::size_t f = 0; f < keep.size(); ++f) keep[f] = !flat[component[f]];
    } else {
      for (const int f : sheet->faces) keep[f] = false;
    }
    report_.floor_faces = keep_faces(keep);
  }

  std::vector<double> component_areas(const std::vector<int>& component, int count) const {
    std::vector<double> areas(count, 0.0);
    for (std::size_t f = 0; f < component.size(); ++f) areas[component[f]] += face_area(mesh_, mesh_.faces[f]);
    return areas;
  }

  /// Small components that no larger one, and no chain of small ones, connects to the body.
  void remove_specks() {
    int count = 0;
    const std::vector<int> component = face_components(mesh_.faces, mesh_.vertices.size(), count);
    if (count < 2) return;
    const std::vector<double> areas = component_areas(component, count);
    const int largest = static_cast<int>(std::max_element(areas.begin(), areas.end()) - areas.begin());
    std::vector<Eigen::AlignedBox3d> boxes(count);
    for (std::size_t f = 0; f < component.size(); ++f)
      for (const int v : mesh_.faces[f]) boxes[component[f]].extend(mesh_.vertices[v]);
    std::vector<bool> body(count, false);
    std::vector<int> fresh;
    for (int c = 0; c < count; ++c)
      if (c == largest || boxes[c].diagonal().norm() > options_.speck_size * height_) {
        body[c] = true;
        fresh.push_back(c);
      }
    std::vector<int> sizes(count, 0);
    for (const int c : component) ++sizes[c];
    for (int round = 0; round < kSpeckRounds && !fresh.empty(); ++round)
      fresh = join_near(component, sizes, fresh, body);
    std::vector<bool> keep(mesh_.faces.size());
    for (std::size_t f = 0; f < keep.size(); ++f) keep[f] = body[component[f]];
    report_.specks = static_cast<int>(std::count(body.begin(), body.end(), false));
    report_.speck_faces = keep_faces(keep);
  }

  /// Marks the components near those of `fresh` as body. @return the marked ones
  std::vector<int> join_near(const std::vector<int>& component, const std::vector<int>& sizes,
                             const std::vector<int>& fresh, std::vector<bool>& body) const {
    const std::set<int> set(fresh.begin(), fresh.end());
    std::vector<Triangle> faces;
    for (std::size_t f = 0; f < component.size(); ++f)
      if (set.count(component[f]) != 0) faces.push_back(mesh_.faces[f]);
    std::vector<Vector3d> finite = mesh_.vertices;
    for (Vector3d& v : finite)
      if (!v.allFinite()) v.setZero();
    const TriangleTree tree(finite, faces);
    std::vector<int> joined, passed(sizes.size(), 0);
    for (std::size_t f = 0; f < component.size(); ++f) {
      if (body[component[f]]) continue;
      const int size = sizes[component[f]];
      // Of a dense component some faces are enough: they lie closer to each other than `reach`.
      if (passed[component[f]]++ % std::max(1, size / kSpeckSamples) != 0) continue;
      const bool tiny = size >= kMinClosedFaces && size <= kFewFaces;
      const double reach = options_.speck_distance * height_ * (tiny ? kTouching : 1.0);
      for (const int v : mesh_.faces[f]) {
        if (tree.closest(mesh_.vertices[v]).squared_distance > reach * reach) continue;
        body[component[f]] = true;
        joined.push_back(component[f]);
        break;
      }
    }
    return joined;
  }

  /// Fills across_: at an edge of more than two faces, those that continue each other most straightly stay together.
  void pair_edges() {
    across_.assign(3 * mesh_.faces.size(), kBorder);
    for_each_edge(sorted_edge_uses(mesh_.faces), [&](const EdgeUse* first, const EdgeUse* last) {
      if (last - first == 2) join_halves(first[0].half, first[1].half);
      if (last - first > 2) {
        ++report_.non_manifold_edges;
        pair_crossing(first, last);
      }
    });
  }

  void join_halves(int a, int b) {
    across_[a] = b;
    across_[b] = a;
  }

  /// From the edge into the face, perpendicular to the edge.
  Vector3d into_face(int half) const {
    const Triangle& face = mesh_.faces[half / 3];
    const Vector3d& a = mesh_.vertices[half_start(mesh_.faces, half)];
    const Vector3d edge = (mesh_.vertices[half_end(mesh_.faces, half)] - a).normalized();
    const Vector3d apex = mesh_.vertices[face[(half % 3 + 2) % 3]] - a;
    return (apex - apex.dot(edge) * edge).normalized();
  }

  void pair_crossing(const EdgeUse* first, const EdgeUse* last) {
    struct Pair {
      double bend;
      int a, b;
    };
    std::vector<Pair> pairs;
    for (const EdgeUse* a = first; a != last; ++a)
      for (const EdgeUse* b = a + 1; b != last; ++b) {
        const bool alike = half_start(mesh_.faces, a->half) != half_start(mesh_.faces, b->half);
        // Faces of different winding continue each other only where nothing else does.
        pairs.push_back({into_face(a->half).dot(into_face(b->half)) + (alike ? 0.0 : 2.0), a->half, b->half});
      }
    std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.bend < b.bend; });
    for (const Pair& pair : pairs)
      if (across_[pair.a] == kBorder && across_[pair.b] == kBorder) join_halves(pair.a, pair.b);
  }

  void wind_alike() {
    std::vector<int> turned(mesh_.faces.size(), -1);  // -1: not visited
    for (std::size_t start = 0; start < turned.size(); ++start) {
      if (turned[start] >= 0) continue;
      turned[start] = 0;
      std::vector<int> patch{static_cast<int>(start)};
      for (std::size_t i = 0; i < patch.size(); ++i) visit_neighbours(patch[i], turned, patch);
      settle_patch(patch, turned);
    }
    const std::vector<int> before = across_;
    const auto position = [&](int half) {
      return half < 0 || turned[half / 3] == 0 ? half : half / 3 * 3 + 2 - half % 3;
    };
    for (std::size_t h = 0; h < before.size(); ++h) across_[position(static_cast<int>(h))] = position(before[h]);
    for (std::size_t f = 0; f < turned.size(); ++f) {
      if (turned[f] == 0) continue;
      ++report_.turned_faces;
      std::swap(mesh_.faces[f][1], mesh_.faces[f][2]);
      if (!mesh_.face_uvs.empty()) std::swap(mesh_.face_uvs[f][1], mesh_.face_uvs[f][2]);
    }
  }

  void visit_neighbours(int face, std::vector<int>& turned, std::vector<int>& patch) {
    for (int k = 0; k < 3; ++k) {
      const int half = 3 * face + k, beyond = across_[half];
      if (beyond < 0) continue;
      const bool alike = half_start(mesh_.faces, half) != half_start(mesh_.faces, beyond);
      const int wanted = alike ? turned[face] : 1 - turned[face];
      int& other = turned[beyond / 3];
      if (other < 0) {
        other = wanted;
        patch.push_back(beyond / 3);
      } else if (other != wanted) {  // a Moebius strip: part it here
        across_[half] = across_[beyond] = kBorder;
      }
    }
  }

  /// The majority of a patch keeps its winding, unless the volume says that it faces inwards.
  void settle_patch(const std::vector<int>& patch, std::vector<int>& turned) const {
    double area = 0.0, turned_area = 0.0;
    Vector3d centre = Vector3d::Zero();
    for (const int f : patch) {
      const Triangle& face = mesh_.faces[f];
      const double here = face_area(mesh_, face);
      area += here;
      turned_area += turned[f] != 0 ? here : 0.0;
      for (const int v : face) centre += here / 3.0 * mesh_.vertices[v];
    }
    centre /= area;
    bool turn = turned_area > 0.5 * area;
    double volume = 0.0;
    for (const int f : patch) {
      const Triangle& face = mesh_.faces[f];
      const Vector3d a = mesh_.vertices[face[0]] - centre, b = mesh_.vertices[face[1]] - centre,
                     c = mesh_.vertices[face[2]] - centre;
      volume += (turned[f] != 0 ? -1.0 : 1.0) * a.dot(b.cross(c)) / 6.0;
    }
    if (std::abs(volume) > kClearVolume * std::pow(area, 1.5)) turn = volume < 0.0;
    if (!turn) return;
    for (const int f : patch) turned[f] = 1 - turned[f];
  }

  /// Corners at one vertex that no chain of edges connects get vertices of their own.
  void split_vertices() {
    JoinedSets corners(3 * mesh_.faces.size());
    for (int h = 0; h < static_cast<int>(across_.size()); ++h) {
      const int beyond = across_[h];
      if (beyond < h) continue;
      corners.join(h, next_corner(beyond));
      corners.join(next_corner(h), beyond);
    }
    std::vector<int> owner(mesh_.vertices.size(), -1);
    std::unordered_map<int, int> copies;
    for (int h = 0; h < static_cast<int>(across_.size()); ++h) {
      int& v = mesh_.faces[h / 3][h % 3];
      const int group = corners.find(h);
      int& first = owner[v];
      if (first < 0) first = group;
      if (first == group) continue;
      const auto [copy, is_new] = copies.emplace(group, mesh_.num_vertices());
      if (is_new) add_vertex_like(v);
      v = copy->second;
    }
    report_.split_vertices = static_cast<int>(copies.size());
  }

  static int next_corner(int half) { return half / 3 * 3 + (half % 3 + 1) % 3; }

  void add_vertex_like(int vertex) {
    mesh_.vertices.push_back(Vector3d(mesh_.vertices[vertex]));
    if (!mesh_.colours.empty()) mesh_.colours.push_back(Vector3d(mesh_.colours[vertex]));
  }

  void fill_holes() {
    const std::vector<BorderLoop> loops = border_loops(mesh_, across_);
    if (loops.empty()) return;
    int count = 0;
    const std::vector<int> component = face_components(mesh_.faces, mesh_.vertices.size(), count);
    const std::vector<double> areas = component_areas(component, count);
    const double total = std::accumulate(areas.begin(), areas.end(), 0.0);
    const bool one_surface = *std::max_element(areas.begin(), areas.end()) > kOneSurface * total;
    const double longest = (one_surface ? options_.hole_length_one_surface : options_.hole_length_parts) * height_;
    find_islands();
    find_border_edges(loops);
    for (const BorderLoop& loop : loops) {
      const double most_area = kLidShare * areas[component[loop.halves[0] / 3]];
      const bool small = loop.length <= longest && static_cast<int>(loop.halves.size()) <= options_.hole_edges;
      if (!small || !fill_hole(loop, most_area)) ++report_.open_borders;
    }
  }

  /// Which texture coordinates belong together.
  void find_islands() {
    if (mesh_.face_uvs.empty()) return;
    JoinedSets sets(mesh_.uvs.size());
    for (const Triangle& face : mesh_.face_uvs) {
      sets.join(face[0], face[1]);
      sets.join(face[0], face[2]);
    }
    islands_.resize(mesh_.uvs.size());
    for (std::size_t i = 0; i < islands_.size(); ++i) islands_[i] = sets.find(static_cast<int>(i));
  }

  /// Edges between border vertices, which a lid must not repeat.
  void find_border_edges(const std::vector<BorderLoop>& loops) {
    std::vector<bool> border(mesh_.vertices.size(), false);
    for (const BorderLoop& loop : loops)
      for (const int half : loop.halves) border[half_start(mesh_.faces, half)] = true;
    for (const Triangle& face : mesh_.faces)
      for (int k = 0; k < 3; ++k)
        if (border[face[k]] && border[face[(k + 1) % 3]]) border_edges_.insert(std::minmax(face[k], face[(k + 1) % 3]));
  }

  bool fill_hole(const BorderLoop& loop, double most_area) {
    const std::size_t n = loop.halves.size();
    std::vector<int> vertices(n);
    std::vector<Vector3d> line(n);
    for (std::size_t i = 0; i < n; ++i) {
      vertices[i] = half_start(mesh_.faces, loop.halves[i]);
      line[i] = mesh_.vertices[vertices[i]];
    }
    std::vector<std::vector<bool>> has_edge(n, std::vector<bool>(n, false));
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = i + 2; j < n; ++j)
        has_edge[i][j] = border_edges_.count(std::minmax(vertices[i], vertices[j])) != 0;
    double area = 0.0;
    const std::vector<Triangle> lid = least_area_triangles(line, has_edge, area);
    if (lid.empty() || area > most_area) return false;
    for (const Triangle& t : lid) {
      mesh_.faces.push_back({vertices[t[0]], vertices[t[1]], vertices[t[2]]});
      for (int k = 0; k < 3; ++k) border_edges_.insert(std::minmax(vertices[t[k]], vertices[t[(k + 1) % 3]]));
      if (!mesh_.face_uvs.empty()) mesh_.face_uvs.push_back(lid_uvs(loop, t));
    }
    ++report_.holes;
    report_.hole_faces += static_cast<int>(lid.size());
    return true;
  }

  /// The border's texture coordinates; where they lie on different islands, those of one corner.
  Triangle lid_uvs(const BorderLoop& loop, const Triangle& corners) const {
    Triangle uvs;
    for (int k = 0; k < 3; ++k) {
      const int half = loop.halves[corners[k]];
      uvs[k] = mesh_.face_uvs[half / 3][half % 3];
    }
    const int island = islands_[uvs[0]];
    const bool one = islands_[uvs[1]] == island && islands_[uvs[2]] == island;
    return one ? uvs : Triangle{uvs[0], uvs[0], uvs[0]};
  }

  /// Removes vertices and texture coordinates that no face uses.
  void compact() {
    std::vector<int> position(mesh_.vertices.size(), 0);
    for (const Triangle& face : mesh_.faces)
      for (const int v : face) position[v] = 1;
    int kept = 0;
    for (std::size_t v = 0; v < position.size(); ++v) {
      if (position[v] == 0) continue;
      mesh_.vertices[kept] = Vector3d(mesh_.vertices[v]);
      if (!mesh_.colours.empty()) mesh_.colours[kept] = Vector3d(mesh_.colours[v]);
      position[v] = kept++;
    }
    mesh_.vertices.resize(kept);
    if (!mesh_.colours.empty()) mesh_.colours.resize(kept);
    for (Triangle& face : mesh_.faces)
      for (int& v : face) v = position[v];
  }

  TriangleMesh mesh_;
  RepairOptions options_;
  RepairReport report_;
  double height_ = 0.0;
  std::vector<int> across_;   // [3 F] the half beyond each half
  std::vector<int> islands_;  // [U]
  std::set<std::pair<int, int>> border_edges_;
};

std::string counted(int count, const char* one, const char* many) {
  return fmt::format("{} {}", count, count == 1 ? one : many);
}

}  // namespace

std::vector<std::string> RepairReport::sentences() const {
  std::vector<std::string> out;
  if (lost_vertices > 0) {
    out.push_back(fmt::format("{} without a finite position (numbers {}{}, counted from 0): dropped with {}.",
                              counted(lost_vertices, "vertex", "vertices"), fmt::join(lost_named, ", "),
                              as_size(lost_vertices) > lost_named.size() ? ", ..." : "",
                              counted(lost_faces, "triangle", "triangles")));
  }
  if (floor_faces > 0)
    out.push_back(
        fmt::format("A floor under the feet: removed with {}.", counted(floor_faces, "triangle", "triangles")));
  if (specks > 0)
    out.push_back(fmt::format("{} away from the body: removed with {}.", counted(specks, "speck", "specks"),
                              counted(speck_faces, "triangle", "triangles")));
  if (holes > 0)
    out.push_back(fmt::format("{}: filled with {}.", counted(holes, "hole", "holes"),
                              counted(hole_faces, "triangle", "triangles")));
  if (welded_vertices > 0)
    out.push_back(fmt::format("{}: welded to others in the same position.",
                              counted(welded_vertices, "doubled vertex", "doubled vertices")));
  if (degenerate_faces > 0)
    out.push_back(fmt::format("{} without area: dropped.", counted(degenerate_faces, "triangle", "triangles")));
  if (duplicate_faces > 0)
    out.push_back(fmt::format("{} given twice: dropped.", counted(duplicate_faces, "triangle", "triangles")));
  if (non_manifold_edges > 0)
    out.push_back(fmt::format("{} of more than two triangles: parted.", counted(non_manifold_edges, "edge", "edges")));
  if (split_vertices > 0)
    out.push_back(fmt::format("{} added where surfaces touched in an edge or a point.",
                              counted(split_vertices, "vertex", "vertices")));
  if (turned_faces > 0)
    out.push_back(fmt::format("{} faced inwards or against their neighbours: turned over.",
                              counted(turned_faces, "triangle", "triangles")));
  if (open_borders > 0)
    out.push_back(
        fmt::format("{} left open (cuffs, hems, large holes).", counted(open_borders, "border line", "border lines")));
  return out;
}

RepairedMesh repair(const TriangleMesh& mesh, const RepairOptions& options) { return ScanRepair(mesh, options).run(); }

}  // namespace doppel
