#include "doppel/rigging/scan/simplify.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <tuple>

#include "doppel/core/error.h"
#include "doppel/rigging/scan/edge_table.h"
#include "doppel/rigging/scan/scan_parts.h"

namespace doppel {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kBorderWeight = 10.0;  // of the planes that hold a border, against those of faces
constexpr double kSeamWeight = 1.0;     // the same for a seam
constexpr double kLengthWeight = 1e-7;  // prefers short edges where the surface is flat
constexpr double kMaxTurn = 0.25;       // cosine of the largest turn of a face in one collapse
constexpr double kMinFaceShape = 0.03;  // twice the area over the squared longest edge; thinner faces are not made
constexpr double kMaxOffset = 0.3;      // of a new vertex above its edge, in lengths of the edge
constexpr double kWorthAnotherPass = 0.01;
constexpr double kBytesPerFace = 180.0, kBytesPerVertex = 160.0;
constexpr int kMinTarget = 4;
constexpr std::uint8_t kCorner = 255;  // a vertex that keeps its position

/// A sum of squared distances to planes: x'Ax + 2 b'x + c.
struct PlaneSum {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, bx = 0, by = 0, bz = 0, c = 0;

  void add_plane(const Vector3d& n, double offset, double weight) {
    xx += weight * n.x() * n.x();
    xy += weight * n.x() * n.y();
    xz += weight * n.x() * n.z();
    yy += weight * n.y() * n.y();
    yz += weight * n.y() * n.z();
    zz += weight * n.z() * n.z();
    bx += weight * offset * n.x();
    by += weight * offset * n.y();
    bz += weight * offset * n.z();
    c += weight * offset * offset;
  }
  PlaneSum operator+(const PlaneSum& o) const {
    return {xx + o.xx, xy + o.xy, xz + o.xz, yy + o.yy, yz + o.yz, zz + o.zz, bx + o.bx, by + o.by, bz + o.bz, c + o.c};
  }
  Vector3d times(const Vector3d& v) const {
    return {xx * v.x() + xy * v.y() + xz * v.z(), xy * v.x() + yy * v.y() + yz * v.z(),
            xz * v.x() + yz * v.y() + zz * v.z()};
  }
  Vector3d half_gradient(const Vector3d& v) const { return times(v) + Vector3d(bx, by, bz); }
  double at(const Vector3d& v) const { return v.dot(times(v)) + 2.0 * Vector3d(bx, by, bz).dot(v) + c; }
};

/// An edge to collapse. It is out of date when the vertices' versions add up to something else: versions only grow.
struct Candidate {
  float cost;
  int a, b;
  std::uint32_t versions;
};
/// For a heap whose top is the cheapest; the vertices decide between equals, so the order is always the same.
bool dearer(const Candidate& x, const Candidate& y) { return std::tie(x.cost, x.a, x.b) > std::tie(y.cost, y.a, y.b); }

/// A neighbour of a vertex over an edge.
struct Neighbour {
  int vertex;
  int faces = 0;              ///< that share the edge
  int here = -1, there = -1;  ///< wedges of the first face
  bool seam = false;
  bool feature() const { return faces != 2 || seam; }
};

/// What a collapse would do: `removed` merges into `kept`, at the share `t` of the way from kept to removed.
struct Collapse {
  int kept = 0, removed = 0;
  double t = 0.0;
  Vector3d position = Vector3d::Zero();
  double cost = 0.0;
};

class Simplification {
 public:
  Simplification(const TriangleMesh& mesh, const SimplifyOptions& options) : options_(options) {
    positions_ = mesh.vertices;
    colours_ = mesh.colours;
    faces_ = mesh.faces;
    list_corners();
    if (!mesh.face_uvs.empty()) make_wedges(mesh);
    versions_.assign(positions_.size(), 0);
    features_.assign(positions_.size(), 0);
    planes_.resize(positions_.size());
    live_faces_ = static_cast<int>(faces_.size());
    for (const int head : heads_) live_vertices_ += head >= 0;
    add_face_planes();
    const std::vector<EdgeUse> uses = sorted_edge_uses(faces_);
    find_features(uses);
    queue_edges(uses);
  }

  void run() {
    while (!done()) {
      const int before = live_vertices_;
      while (!done() && !heap_.empty()) {
        std::pop_heap(heap_.begin(), heap_.end(), dearer);
        const Candidate best = heap_.back();
        heap_.pop_back();
        if (best.versions == versions_[best.a] + versions_[best.b] && heads_[best.a] >= 0 && heads_[best.b] >= 0)
          try_collapse(best.a, best.b);
      }
      // What a neighbour forbade before may be possible now.
      if (done() || before - live_vertices_ < kWorthAnotherPass * before) return;
      queue_all_again();
    }
  }

  bool done() const {
    return (options_.target_faces > 0 && live_faces_ <= options_.target_faces) ||
           (options_.target_vertices > 0 && live_vertices_ <= options_.target_vertices);
  }

  TriangleMesh result(const TriangleMesh& mesh) const {
    TriangleMesh out;
    out.texture = mesh.texture;
    std::vector<int> new_vertex(positions_.size(), -1), new_wedge(uvs_.size(), -1);
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      if (dead(static_cast<int>(f))) continue;
      out.faces.push_back(faces_[f]);
      for (int& v : out.faces.back()) {
        if (new_vertex[v] < 0) {
          new_vertex[v] = out.num_vertices();
          out.vertices.push_back(positions_[v]);
          if (!colours_.empty()) out.colours.push_back(colours_[v]);
        }
        v = new_vertex[v];
      }
      if (wedges_.empty()) continue;
      out.face_uvs.push_back(wedges_[f]);
      for (int& w : out.face_uvs.back()) {
        if (new_wedge[w] < 0) {
          new_wedge[w] = static_cast<int>(out.uvs.size());
          out.uvs.push_back(uvs_[w]);
        }
        w = new_wedge[w];
      }
    }
    return out;
  }

 private:
  bool dead(int face) const { return faces_[face][0] < 0; }
  int vertex_at(int corner) const { return faces_[corner / 3][corner % 3]; }
  int wedge_at(int corner) const { return wedges_.empty() ? 0 : wedges_[corner / 3][corner % 3]; }
  static int next_in_face(int corner, int steps) { return corner / 3 * 3 + (corner % 3 + steps) % 3; }

  /// Calls action(corner) for the corners at a vertex.
  template <typename Action>
  void for_corners(int vertex, const Action& action) const {
    for (int corner = heads_[vertex]; corner >= 0; corner = next_[corner]) action(corner);
  }

  void list_corners() {
    heads_.assign(positions_.size(), -1);
    next_.assign(3 * faces_.size(), -1);
    for (int corner = static_cast<int>(next_.size()) - 1; corner >= 0; --corner) {
      int& head = heads_[vertex_at(corner)];
      next_[corner] = head;
      head = corner;
    }
  }

  /// Each vertex gets UVs of its own: one for each different value among its corners.
  void make_wedges(const TriangleMesh& mesh) {
    wedges_ = mesh.face_uvs;
    for (std::size_t v = 0; v < positions_.size(); ++v) {
      const std::size_t first = uvs_.size();
      for_corners(static_cast<int>(v), [&](int corner) {
        int& wedge = wedges_[corner / 3][corner % 3];
        const Vector2d& uv = mesh.uvs[mesh.face_uvs[corner / 3][corner % 3]];
        std::size_t slot = first;
        while (slot < uvs_.size() && uvs_[slot] != uv) ++slot;
        if (slot == uvs_.size()) uvs_.push_back(uv);
        wedge = static_cast<int>(slot);
      });
    }
  }

  Vector3d twice_area(int face) const {
    const auto& [a, b, c] = faces_[face];
    return (positions_[b] - positions_[a]).cross(positions_[c] - positions_[a]);
  }

  void add_face_planes() {
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const Vector3d normal = twice_area(static_cast<int>(f));
      const double length = normal.norm();
      if (!(length > 0.0)) continue;
      const Vector3d unit = normal / length;
      for (const int v : faces_[f]) planes_[v].add_plane(unit, -unit.dot(positions_[faces_[f][0]]), length / 6.0);
    }
  }

  /// A plane through the edge, upright on the face, for both ends.
  void hold_edge(int half, double weight) {
    const int a = half_start(faces_, half), b = half_end(faces_, half);
    const Vector3d edge = positions_[b] - positions_[a], normal = edge.cross(twice_area(half / 3));
    const double length = normal.norm();
    if (!(length > 0.0)) return;
    const Vector3d unit = normal / length;
    for (const int v : {a, b}) planes_[v].add_plane(unit, -unit.dot(positions_[a]), weight * edge.squaredNorm());
  }

  bool seam_between(int half_a, int half_b) const {
    if (wedges_.empty()) return false;
    const bool alike = vertex_at(half_a) != vertex_at(half_b);
    const int end_a = next_in_face(half_a, 1), end_b = next_in_face(half_b, 1);
    return wedge_at(half_a) != wedge_at(alike ? end_b : half_b) || wedge_at(end_a) != wedge_at(alike ? half_b : end_b);
  }

  /// Counts the borders and seams that meet at each vertex; all but 0 and 2 make a corner.
  void find_features(const std::vector<EdgeUse>& uses) {
    for_each_edge(uses, [&](const EdgeUse* first, const EdgeUse* last) {
      const auto count = last - first;
      const bool seam = count == 2 && seam_between(first[0].half, first[1].half);
      if (count == 2 && !seam) return;
      for (const int v : {first->low, first->high})
        features_[v] = count > 2 || features_[v] >= 2 ? kCorner : static_cast<std::uint8_t>(features_[v] + 1);
      for (const EdgeUse* use = first; use != last; ++use) hold_edge(use->half, seam ? kSeamWeight : kBorderWeight);
    });
    for (std::uint8_t& feature : features_)
      if (feature == 1) feature = kCorner;
  }

  void queue_edges(const std::vector<EdgeUse>& uses) {
    heap_.reserve(uses.size());
    for_each_edge(uses, [&](const EdgeUse* first, const EdgeUse* last) {
      const auto count = last - first;
      if (count > 2) return;
      const bool feature = count == 1 || seam_between(first[0].half, first[1].half);
      append(first->low, first->high, feature);
    });
    std::make_heap(heap_.begin(), heap_.end(), dearer);
  }

  void queue_all_again() {
    heap_.clear();
    std::vector<Neighbour> around;
    for (std::size_t v = 0; v < heads_.size(); ++v) {
      if (heads_[v] < 0) continue;
      list_neighbours(static_cast<int>(v), around);
      for (const Neighbour& n : around)
        if (n.vertex > static_cast<int>(v) && n.faces <= 2) append(static_cast<int>(v), n.vertex, n.feature());
    }
    std::make_heap(heap_.begin(), heap_.end(), dearer);
  }

  void append(int a, int b, bool feature) {
    const std::optional<Collapse> collapse = plan(a, b, feature);
    if (!collapse) return;
    heap_.push_back({static_cast<float>(collapse->cost), std::min(a, b), std::max(a, b), versions_[a] + versions_[b]});
  }

  void list_neighbours(int vertex, std::vector<Neighbour>& around) const {
    around.clear();
    for_corners(vertex, [&](int corner) {
      for (const int steps : {1, 2}) {
        const int other = next_in_face(corner, steps);
        const int v = vertex_at(other), here = wedge_at(corner), there = wedge_at(other);
        const auto known =
            std::find_if(around.begin(), around.end(), [&](const Neighbour& n) { return n.vertex == v; });
        if (known == around.end()) {
          around.push_back({v, 1, here, there, false});
        } else {
          ++known->faces;
          known->seam = known->seam || known->here != here || known->there != there;
        }
      }
    });
  }

  /// Where the ends of an edge would merge, and at what cost; nothing if borders or seams forbid it.
  std::optional<Collapse> plan(int a, int b, bool feature) const {
    // Of a chain and a corner, the corner stays; of the surface and a chain, the chain.
    const auto rank = [&](int v) { return features_[v] == kCorner ? 2 : features_[v] > 0 ? 1 : 0; };
    Collapse out;
    out.kept = std::min(a, b);
    out.removed = std::max(a, b);
    if (rank(out.removed) > rank(out.kept)) std::swap(out.kept, out.removed);
    const int kept = rank(out.kept), removed = rank(out.removed);
    if (removed == 2 || (removed == 1) != feature) return std::nullopt;
    const PlaneSum planes = planes_[out.kept] + planes_[out.removed];
    const Vector3d &start = positions_[out.kept], along = positions_[out.removed] - start;
    const bool free = kept == removed;
    out.t = free ? best_share(planes, start, along) : 0.0;
    out.position = start + out.t * along;
    if (free) out.position += offset_above(planes, out);
    const double squared = along.squaredNorm();
    out.cost = std::max(0.0, planes.at(out.position)) + kLengthWeight * squared * squared;
    if (feature && !wedges_.empty()) out.cost += options_.texture_weight * texture_slide(out) * squared;
    return out;
  }

  static double best_share(const PlaneSum& planes, const Vector3d& start, const Vector3d& along) {
    const double curvature = along.dot(planes.times(along));
    const double trace = planes.xx + planes.yy + planes.zz;
    if (!(curvature > 1e-6 * trace * along.squaredNorm())) return 0.5;
    return std::clamp(-along.dot(planes.half_gradient(start)) / curvature, 0.0, 1.0);
  }

  /// Straight above the edge the surface may be curved; the texture does not slide there.
  Vector3d offset_above(const PlaneSum& planes, const Collapse& collapse) const {
    const Vector3d along = positions_[collapse.removed] - positions_[collapse.kept];
    Vector3d normal = Vector3d::Zero();
    for (const int v : {collapse.kept, collapse.removed})
      for_corners(v, [&](int corner) { normal += twice_area(corner / 3); });
    normal -= normal.dot(along) / std::max(along.squaredNorm(), 1e-300) * along;
    const double length = normal.norm();
    if (!(length > 0.0)) return Vector3d::Zero();
    normal /= length;
    const double curvature = normal.dot(planes.times(normal));
    if (!(curvature > 0.0)) return Vector3d::Zero();
    const double most = kMaxOffset * along.norm();
    return std::clamp(-normal.dot(planes.half_gradient(collapse.position)) / curvature, -most, most) * normal;
  }

  /// The squared distance on the surface by which the seam in the texture would move, where the removed vertex was.
  double texture_slide(const Collapse& collapse) const {
    double most = 0.0;
    // The edge's faces name the wedges of both ends; the same wedges name the seam's next vertex.
    for_corners(collapse.removed, [&](int corner) {
      for (const int steps : {1, 2}) {
        const int other = next_in_face(corner, steps);
        if (vertex_at(other) != collapse.kept) continue;
        const Vector2d &here = uvs_[wedge_at(corner)], &there = uvs_[wedge_at(other)];
        const double scale = (positions_[collapse.removed] - positions_[collapse.kept]).squaredNorm() /
                             std::max((here - there).squaredNorm(), 1e-12);
        const std::optional<Vector2d> before = seam_before(collapse, wedge_at(corner));
        if (!before) continue;
        const Vector2d merged = there + collapse.t * (here - there), line = merged - *before;
        const double length = line.squaredNorm();
        const double t = length > 0.0 ? std::clamp((here - *before).dot(line) / length, 0.0, 1.0) : 0.0;
        most = std::max(most, scale * (here - *before - t * line).squaredNorm());
      }
    });
    return most;
  }

  /// The UV of the seam's vertex before the removed one, on the side of `wedge`.
  std::optional<Vector2d> seam_before(const Collapse& collapse, int wedge) const {
    std::optional<Vector2d> found;
    for_corners(collapse.removed, [&](int corner) {
      if (wedge_at(corner) != wedge || found) return;
      for (const int steps : {1, 2}) {
        const int other = next_in_face(corner, steps);
        if (vertex_at(other) == collapse.kept || features_[vertex_at(other)] == 0) continue;
        if (feature_edge(collapse.removed, vertex_at(other))) found = uvs_[wedge_at(other)];
      }
    });
    return found;
  }

  bool feature_edge(int a, int b) const {
    int faces = 0, here = -1, there = -1;
    bool seam = false;
    for_corners(a, [&](int corner) {
      for (const int steps : {1, 2}) {
        const int other = next_in_face(corner, steps);
        if (vertex_at(other) != b) continue;
        seam = seam || (faces > 0 && (wedge_at(corner) != here || wedge_at(other) != there));
        here = wedge_at(corner);
        there = wedge_at(other);
        ++faces;
      }
    });
    return faces != 2 || seam;
  }

  void try_collapse(int a, int b) {
    list_neighbours(a, around_a_);
    list_neighbours(b, around_b_);
    const auto edge =
        std::find_if(around_a_.begin(), around_a_.end(), [&](const Neighbour& n) { return n.vertex == b; });
    if (edge == around_a_.end() || edge->faces > 2 || !linked_only_by_edge(edge->faces)) return;
    const std::optional<Collapse> collapse = plan(a, b, edge->feature());
    if (!collapse || !find_wedges(*collapse) || turns_over(*collapse)) return;
    apply(*collapse);
  }

  /// A collapse keeps the kind of the surface if the ends share no neighbours but those of their common faces.
  bool linked_only_by_edge(int faces) const {
    int common = 0;
    for (const Neighbour& n : around_a_)
      common +=
          std::any_of(around_b_.begin(), around_b_.end(), [&](const Neighbour& m) { return m.vertex == n.vertex; });
    // A closed component of four faces would become flat.
    return common == faces && !(faces == 2 && around_a_.size() <= 3 && around_b_.size() <= 3);
  }

  /// Which wedge of the kept vertex takes over each wedge of the removed one, by the faces that they share.
  bool find_wedges(const Collapse& collapse) {
    wedge_map_.clear();
    if (wedges_.empty()) return true;
    bool clear = true;
    for_corners(collapse.removed, [&](int corner) {
      for (const int steps : {1, 2}) {
        const int other = next_in_face(corner, steps);
        if (vertex_at(other) != collapse.kept) continue;
        for (const auto& [from, to] : wedge_map_) {
          clear = clear && (from != wedge_at(corner) || to == wedge_at(other));
          // Two wedges may only become one where the texture is torn at the removed vertex alone.
          clear = clear && (to != wedge_at(other) || from == wedge_at(corner) || collapse.t == 0.0);
        }
        wedge_map_.emplace_back(wedge_at(corner), wedge_at(other));
      }
    });
    for_corners(collapse.removed, [&](int corner) {
      clear = clear && std::any_of(wedge_map_.begin(), wedge_map_.end(),
                                   [&](const auto& pair) { return pair.first == wedge_at(corner); });
    });
    return clear;
  }

  int mapped(int wedge) const {
    for (const auto& [from, to] : wedge_map_)
      if (from == wedge) return to;
    return wedge;
  }

  Vector2d merged_uv(const Collapse& collapse, int wedge) const {
    for (const auto& [from, to] : wedge_map_)
      if (from == wedge || to == wedge) return uvs_[to] + collapse.t * (uvs_[from] - uvs_[to]);
    return uvs_[wedge];
  }

  bool turns_over(const Collapse& collapse) const {
    bool bad = false;
    for (const int v : {collapse.kept, collapse.removed}) {
      const int other = v == collapse.kept ? collapse.removed : collapse.kept;
      for_corners(v, [&](int corner) {
        if (bad) return;
        const int second = next_in_face(corner, 1), third = next_in_face(corner, 2);
        if (vertex_at(second) == other || vertex_at(third) == other) return;  // this face goes
        bad = face_turns_over(collapse.position, corner, second, third) ||
              (!wedges_.empty() && uv_turns_over(merged_uv(collapse, wedge_at(corner)), corner, second, third));
      });
    }
    return bad;
  }

  bool face_turns_over(const Vector3d& position, int corner, int second, int third) const {
    const Vector3d &b = positions_[vertex_at(second)], &c = positions_[vertex_at(third)];
    const Vector3d before = twice_area(corner / 3), after = (b - position).cross(c - position);
    const double area = after.norm(), area_before = before.norm();
    const auto longest = [&](const Vector3d& a) {
      return std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
    };
    const double shape = area / longest(position), shape_before = area_before / longest(positions_[vertex_at(corner)]);
    if (shape < kMinFaceShape && shape < shape_before) return true;
    return !(before.dot(after) >= kMaxTurn * area * area_before);
  }

  bool uv_turns_over(const Vector2d& uv, int corner, int second, int third) const {
    const auto area = [&](const Vector2d& a) {
      const Vector2d e = uvs_[wedge_at(second)] - a, f = uvs_[wedge_at(third)] - a;
      return e.x() * f.y() - e.y() * f.x();
    };
    const double before = area(uvs_[wedge_at(corner)]);
    return before != 0.0 && !(before * area(uv) > 0.0);
  }

  void apply(const Collapse& collapse) {
    const int kept = collapse.kept, removed = collapse.removed;
    merged_.clear();
    for (const auto& [from, to] : wedge_map_) merged_.push_back(merged_uv(collapse, to));
    for (std::size_t i = 0; i < merged_.size(); ++i) uvs_[wedge_map_[i].second] = merged_[i];
    positions_[kept] = collapse.position;
    if (!colours_.empty())
      colours_[kept] = Vector3d(colours_[kept] + collapse.t * (colours_[removed] - colours_[kept]));
    planes_[kept] = planes_[kept] + planes_[removed];

    ++versions_[kept];
    ++versions_[removed];
    for_corners(removed, [&](int corner) {
      const int f = corner / 3;
      const Triangle& face = faces_[f];
      if (face[0] != kept && face[1] != kept && face[2] != kept) return;
      dying_.push_back(f);
    });
    for (const int f : dying_) kill(f);
    dying_.clear();
    int last = -1;
    for (int corner = heads_[removed]; corner >= 0; corner = next_[corner]) {
      faces_[corner / 3][corner % 3] = kept;
      if (!wedges_.empty()) wedges_[corner / 3][corner % 3] = mapped(wedge_at(corner));
      last = corner;
    }
    if (last >= 0) {
      // A vertex without a face was counted as gone; one that takes over faces is there again.
      live_vertices_ += heads_[kept] < 0;
      next_[last] = heads_[kept];
      heads_[kept] = heads_[removed];
    }
    if (heads_[removed] >= 0) --live_vertices_;
    heads_[removed] = -1;
    queue_around(kept);
  }

  void kill(int face) {
    for (int k = 0; k < 3; ++k) {
      const int corner = 3 * face + k;
      int* link = &heads_[faces_[face][k]];
      while (*link != corner) link = &next_[*link];
      *link = next_[corner];
      live_vertices_ -= heads_[faces_[face][k]] < 0;
    }
    faces_[face] = {-1, -1, -1};
    --live_faces_;
  }

  void queue_around(int vertex) {
    if (heads_[vertex] < 0) return;
    list_neighbours(vertex, around_a_);
    for (const Neighbour& n : around_a_) {
      if (n.faces > 2) continue;
      const std::size_t before = heap_.size();
      append(vertex, n.vertex, n.feature());
      if (heap_.size() > before) std::push_heap(heap_.begin(), heap_.end(), dearer);
    }
  }

  SimplifyOptions options_;
  std::vector<Vector3d> positions_, colours_;
  std::vector<Triangle> faces_, wedges_;  // dead faces are {-1,-1,-1}
  std::vector<Vector2d> uvs_;             // [wedges]
  std::vector<int> heads_, next_;         // the corners at each vertex, as chains; -1 ends one
  std::vector<PlaneSum> planes_;
  std::vector<std::uint32_t> versions_;
  std::vector<std::uint8_t> features_;  // 0 in the surface, 2 on a border or seam, kCorner
  std::vector<Candidate> heap_;
  int live_faces_ = 0, live_vertices_ = 0;
  // Kept to save allocations.
  std::vector<Neighbour> around_a_, around_b_;
  std::vector<std::pair<int, int>> wedge_map_;
  std::vector<Vector2d> merged_;
  std::vector<int> dying_;
};

void check_simplify_input(const TriangleMesh& mesh, const SimplifyOptions& options) {
  check_scan_mesh(mesh, "simplifying the scan");
  if (options.target_faces <= 0 && options.target_vertices <= 0)
    fail<UsageError>("simplifying the scan: no target is given; give a number of triangles or of vertices");
  const auto check_target = [](int target, const char* what) {
    if (target != 0 && target < kMinTarget)
      fail<UsageError>("simplifying the scan: the target is {} {}, at least {} are needed", target, what, kMinTarget);
  };
  check_target(options.target_faces, "triangles");
  check_target(options.target_vertices, "vertices");
  for (const Triangle& face : mesh.faces)
    for (const int v : face)
      if (!mesh.vertices[v].allFinite())
        fail<UsageError>("simplifying the scan: vertex {} is not finite; repair the mesh first", v);
  const std::size_t needed = simplify_memory(mesh);
  if (needed > options.memory_limit)
    fail<UsageError>(
        "simplifying the scan: {} triangles need {:.1f} GB of memory, {:.1f} GB are allowed; reduce the scan in the "
        "scanning program first",
        mesh.num_faces(), static_cast<double>(needed) / 1e9, static_cast<double>(options.memory_limit) / 1e9);
}

}  // namespace

std::size_t simplify_memory(const TriangleMesh& mesh) {
  return static_cast<std::size_t>(kBytesPerFace * static_cast<double>(mesh.faces.size()) +
                                  kBytesPerVertex * static_cast<double>(mesh.vertices.size()));
}

TriangleMesh simplify(const TriangleMesh& mesh, const SimplifyOptions& options, SimplifyReport* report) {
  check_simplify_input(mesh, options);
  Simplification simplification(mesh, options);
  simplification.run();
  TriangleMesh out = simplification.result(mesh);
  if (report != nullptr) {
    report->faces = out.num_faces();
    report->vertices = out.num_vertices();
    report->reached = simplification.done();
    report->sentence = fmt::format("Simplified {} triangles to {}{}.", mesh.num_faces(), out.num_faces(),
                                   report->reached ? "" : "; borders and seams allow no fewer");
  }
  return out;
}

}  // namespace doppel
