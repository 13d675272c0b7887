#include "doppel/rigging/joints/find_fingers.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <queue>

#include "doppel/geometry/topology.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr double kReach = 1.5;       // radius of the region of a hand, of its length
constexpr double kBehind = -0.15;    // where the region begins, from the wrist towards the tips, of the hand's length
constexpr double kWristRing = 0.12;  // the surface within this distance from the wrist's plane has the distance 0
constexpr double kStandOut = 0.1;    // least height of a tip above its saddle
constexpr int kSections = 24;        // of a finger
// Lengths of phalanges and of the soft tissue beyond them, mm (Buryanov and Kotiuk 2010): metacarpal (thumb only),
// proximal, middle (not of the thumb), distal, soft.
struct Phalanges {
  double metacarpal, proximal, middle, distal, soft;
};
constexpr std::array<Phalanges, kFingers.size()> kPhalanges{{{46.22, 31.57, 0.0, 21.67, 3.95},
                                                             {0.0, 39.78, 22.38, 15.82, 3.84},
                                                             {0.0, 44.63, 26.33, 17.40, 3.95},
                                                             {0.0, 41.37, 25.65, 17.30, 3.95},
                                                             {0.0, 32.74, 18.11, 15.96, 3.73}}};
constexpr double kFreeOfFinger = 0.5, kFreeOfThumb = 0.6;  // shares of the proximal phalanx beyond the web
constexpr double kMaxWay = 0.8;  // the first joint of the thumb lies at most this far from its second to the wrist

/// A hand: where it begins and where it points.
struct Hand {
  Vector3d wrist, along;
  double length;  ///< from the wrist to the tip of the middle finger, by the proportions of an adult
};

Hand hand_of(const BodyJoints& joints, const std::string& side) {
  const Vector3d &wrist = joints.at(side + "wrist"), forearm = wrist - joints.at(side + "elbow");
  constexpr double kOfForearm = 0.72;  // as complete_joints has it
  return {wrist, forearm.normalized(), kOfForearm * forearm.norm()};
}

/// The surface of a hand: one connected part of the mesh, and the distance of its vertices from the wrist along edges.
struct HandSurface {
  std::vector<Vector3d> positions;           ///< [n]
  std::vector<std::vector<int>> neighbours;  ///< [n]
  std::vector<double> distance;              ///< [n]
  double at(int vertex) const { return distance[static_cast<std::size_t>(vertex)]; }
  const Vector3d& position(int vertex) const { return positions[static_cast<std::size_t>(vertex)]; }
};

/// The vertices of the part of `region` that is nearest to a point.
std::vector<int> part_near(const std::vector<int>& region, const MeshTopology& topology, const TriangleMesh& mesh,
                           const Vector3d& point) {
  if (region.empty()) return {};
  std::vector<bool> wanted(mesh.vertices.size(), false);
  for (const int v : region) wanted[static_cast<std::size_t>(v)] = true;
  const auto from_point = [&](int v) { return (mesh.vertices[static_cast<std::size_t>(v)] - point).squaredNorm(); };
  std::vector<int> part{
      *std::min_element(region.begin(), region.end(), [&](int a, int b) { return from_point(a) < from_point(b); })};
  wanted[static_cast<std::size_t>(part.front())] = false;
  for (std::size_t i = 0; i < part.size(); ++i)
    for (const int next : topology.one_ring().row(part[i]))
      if (wanted[static_cast<std::size_t>(next)]) {
        wanted[static_cast<std::size_t>(next)] = false;
        part.push_back(next);
      }
  return part;
}

void measure_distances(HandSurface& surface, const Hand& hand) {
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  surface.distance.assign(surface.positions.size(), std::numeric_limits<double>::infinity());
  for (std::size_t v = 0; v < surface.positions.size(); ++v)
    if ((surface.positions[v] - hand.wrist).dot(hand.along) < kWristRing * hand.length) {
      surface.distance[v] = 0.0;
      queue.emplace(0.0, static_cast<int>(v));
    }
  while (!queue.empty()) {
    const auto [here, v] = queue.top();
    queue.pop();
    if (here > surface.at(v)) continue;
    for (const int next : surface.neighbours[static_cast<std::size_t>(v)]) {
      const double there = here + (surface.position(next) - surface.position(v)).norm();
      if (there < surface.at(next)) queue.emplace(surface.distance[static_cast<std::size_t>(next)] = there, next);
    }
  }
}

HandSurface hand_surface(const TriangleMesh& mesh, const MeshTopology& topology, const Hand& hand) {
  std::vector<int> region;
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    const Vector3d from_wrist = mesh.vertices[static_cast<std::size_t>(v)] - hand.wrist;
    if (from_wrist.norm() < kReach * hand.length && from_wrist.dot(hand.along) > kBehind * hand.length)
      region.push_back(v);
  }
  const std::vector<int> part = part_near(region, topology, mesh, hand.wrist + 0.3 * hand.length * hand.along);
  std::vector<int> number(mesh.vertices.size(), -1);
  for (std::size_t i = 0; i < part.size(); ++i) number[static_cast<std::size_t>(part[i])] = static_cast<int>(i);
  HandSurface surface;
  for (const int v : part) {
    surface.positions.push_back(mesh.vertices[static_cast<std::size_t>(v)]);
    std::vector<int>& neighbours = surface.neighbours.emplace_back();
    for (const int next : topology.one_ring().row(v))
      if (const int other = number[static_cast<std::size_t>(next)]; other >= 0) neighbours.push_back(other);
  }
  measure_distances(surface, hand);
  return surface;
}

/// A tip and the vertices that lie higher than its saddle.
struct Peak {
  int tip = 0, saddle = 0;
  std::vector<int> vertices;
};

/// The peaks that stand out, by joining vertices from the highest to the lowest. Where two peaks meet, the lower one
/// ends. The highest one has the saddle at which the first other peak that stands out meets it.
class PeakSearch {
 public:
  PeakSearch(const HandSurface& surface, double stand_out)
      : surface_(surface), stand_out_(stand_out), group_(surface.positions.size(), -1), peaks_(group_.size()) {
    std::vector<int> order(group_.size());
    std::iota(order.begin(), order.end(), 0);
    std::erase_if(order, [&](int v) { return !std::isfinite(surface.at(v)); });
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return surface.at(a) > surface.at(b); });
    for (const int v : order) add(v);
  }
  std::vector<Peak> found;

 private:
  int root(int v) {
    while (group_[static_cast<std::size_t>(v)] != v)
      v = group_[static_cast<std::size_t>(v)] = group_[static_cast<std::size_t>(group_[static_cast<std::size_t>(v)])];
    return v;
  }
  Peak& peak(int root) { return peaks_[static_cast<std::size_t>(root)]; }

  void add(int v) {
    std::vector<int> roots;
    for (const int next : surface_.neighbours[static_cast<std::size_t>(v)])
      if (group_[static_cast<std::size_t>(next)] >= 0) roots.push_back(root(next));
    std::sort(roots.begin(), roots.end(), [&](int a, int b) {
      return std::pair(-surface_.at(peak(a).tip), a) < std::pair(-surface_.at(peak(b).tip), b);
    });
    roots.erase(std::unique(roots.begin(), roots.end()), roots.end());
    group_[static_cast<std::size_t>(v)] = v;
    if (roots.empty()) {
      peak(v) = {v, v, {v}};
      return;
    }
    for (std::size_t i = 1; i < roots.size(); ++i) join(roots[i], roots[0], v);
    group_[static_cast<std::size_t>(v)] = roots[0];
    peak(roots[0]).vertices.push_back(v);
  }

  void join(int lower, int higher, int saddle) {
    if (surface_.at(peak(lower).tip) - surface_.at(saddle) > stand_out_) {
      keep(lower, saddle);
      keep(higher, saddle);
    }
    std::vector<int>& all = peak(higher).vertices;
    all.insert(all.end(), peak(lower).vertices.begin(), peak(lower).vertices.end());
    group_[static_cast<std::size_t>(lower)] = higher;
  }

  void keep(int root, int saddle) {
    const int tip = peak(root).tip;
    if (std::none_of(found.begin(), found.end(), [&](const Peak& known) { return known.tip == tip; }))
      found.push_back({tip, saddle, peak(root).vertices});
  }

  const HandSurface& surface_;
  double stand_out_;
  std::vector<int> group_;   ///< [n] union-find; -1: not added yet
  std::vector<Peak> peaks_;  ///< [n] of the roots
};

/// From the tip to the web.
using Line = std::vector<Vector3d>;

Line centre_line(const HandSurface& surface, const Peak& peak) {
  std::vector<bool> inside(surface.positions.size(), false);
  for (const int v : peak.vertices) inside[static_cast<std::size_t>(v)] = true;
  const double high = surface.at(peak.tip), low = surface.at(peak.saddle);
  std::vector<Vector3d> sum(kSections, Vector3d::Zero());
  std::vector<int> count(kSections, 0);
  for (const int a : peak.vertices)
    for (const int b : surface.neighbours[static_cast<std::size_t>(a)]) {
      if (!inside[static_cast<std::size_t>(b)] || !(surface.at(a) > surface.at(b))) continue;
      for (int s = 1; s < kSections; ++s) {
        const double level = high + (low - high) * s / kSections;
        if (!(surface.at(b) <= level && level < surface.at(a))) continue;
        const double share = (surface.at(a) - level) / (surface.at(a) - surface.at(b));
        sum[static_cast<std::size_t>(s)] += surface.position(a) + share * (surface.position(b) - surface.position(a));
        ++count[static_cast<std::size_t>(s)];
      }
    }
  constexpr int kMinCrossings = 3;  // crossings of a section that goes around the finger
  Line line{surface.position(peak.tip)};
  for (std::size_t s = 0; s < sum.size(); ++s)
    if (count[s] >= kMinCrossings) line.push_back(sum[s] / count[s]);
  return line;
}

double length_of(const Line& line) {
  double length = 0.0;
  for (std::size_t i = 1; i < line.size(); ++i) length += (line[i] - line[i - 1]).norm();
  return length;
}

/// The point at a distance from the tip; beyond the web, on the straight line through the lower half.
Vector3d point_at(const Line& line, double distance) {
  for (std::size_t i = 1; i < line.size(); ++i) {
    const double step = (line[i] - line[i - 1]).norm();
    if (distance <= step) return line[i - 1] + distance / std::max(step, 1e-9) * (line[i] - line[i - 1]);
    distance -= step;
  }
  return line.back() + distance * (line.back() - line[line.size() / 2]).normalized();
}

/// Points 1 to 4 of a finger. @param finger index in kFingers
std::array<Vector3d, kFingerPoints> points_of(const Line& line, std::size_t finger, const Vector3d& wrist) {
  const Phalanges& p = kPhalanges[finger];
  const bool thumb = finger == 0;
  const double free = p.soft + p.distal + p.middle + (thumb ? kFreeOfThumb : kFreeOfFinger) * p.proximal;
  const double scale = length_of(line) / free;
  const Vector3d last = point_at(line, scale * (p.soft + p.distal)),
                 before = point_at(line, scale * (p.soft + p.distal + (thumb ? p.proximal : p.middle)));
  if (!thumb) return {point_at(line, scale * (free + (1.0 - kFreeOfFinger) * p.proximal)), before, last, line.front()};
  const Vector3d way = wrist - before;
  return {before + std::min(kMaxWay, scale * p.metacarpal / way.norm()) * way, before, last, line.front()};
}

/// The lines in the order of kFingers. @param peaks of five fingers
std::array<Line, kFingers.size()> ordered_lines(const HandSurface& surface, std::vector<Peak> peaks) {
  std::sort(peaks.begin(), peaks.end(),
            [&](const Peak& a, const Peak& b) { return surface.at(a.tip) < surface.at(b.tip); });
  std::array<Line, kFingers.size()> lines;
  for (std::size_t i = 0; i < lines.size(); ++i) lines[i] = centre_line(surface, peaks[i]);
  Eigen::Matrix<double, 4, 3> webs;
  for (int i = 0; i < 4; ++i) webs.row(i) = lines[static_cast<std::size_t>(i) + 1].back();
  const Eigen::RowVector3d middle = webs.colwise().mean();
  Vector3d across = Eigen::JacobiSVD<Eigen::MatrixXd>(webs.rowwise() - middle, Eigen::ComputeThinV).matrixV().col(0);
  if ((lines[0].back() - middle.transpose()).dot(across) > 0.0) across = -across;
  std::sort(lines.begin() + 1, lines.end(),
            [&](const Line& a, const Line& b) { return a.back().dot(across) < b.back().dot(across); });
  return lines;
}

std::string find_in_hand(const TriangleMesh& mesh, const MeshTopology& topology, const std::string& side,
                         BodyJoints& joints) {
  const std::string name = side.substr(0, side.size() - 1);
  const Hand hand = hand_of(joints, side);
  const HandSurface surface = hand_surface(mesh, topology, hand);
  const std::vector<Peak> peaks = PeakSearch(surface, kStandOut * hand.length).found;
  if (peaks.size() != kFingers.size())
    return fmt::format(
        "the {} hand moves as one piece: {} of its fingers stand apart in the scan, and all five must; to give it "
        "fingers, scan it open, or add their points to the file of --joints",
        name, peaks.size());
  const std::array<Line, kFingers.size()> lines = ordered_lines(surface, peaks);
  for (std::size_t f = 0; f < kFingers.size(); ++f) {
    const auto points = points_of(lines[f], f, hand.wrist);
    for (std::size_t k = 0; k < points.size(); ++k)
      joints.positions[finger_point(side, kFingers[f], static_cast<int>(k) + 1)] = points[k];
  }
  joints.positions[side + "hand"] = joints.at(finger_point(side, kFingers[2], 1));
  joints.positions[side + "fingertip"] = joints.at(finger_point(side, kFingers[2], kFingerPoints));
  return fmt::format("the {} hand has five fingers", name);
}

}  // namespace

std::vector<std::string> find_fingers(const TriangleMesh& mesh, BodyJoints& joints) {
  const MeshTopology topology(mesh);
  std::vector<std::string> notes;
  for (const char* side : {"left_", "right_"})
    if (!has_fingers(joints, side)) notes.push_back(find_in_hand(mesh, topology, side, joints));
  return notes;
}

}  // namespace doppel
