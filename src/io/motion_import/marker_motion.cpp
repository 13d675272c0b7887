#include "doppel/io/motion_import/marker_motion.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/detect/keypoints/read_space_points.h"
#include "doppel/geometry/best_rotation.h"
#include "doppel/geometry/up_axis.h"
#include "doppel/io/motion_import/marker_names.h"
#include "doppel/io/motion_import/rest_figure.h"
#include "doppel/io/motion_import/vertical.h"

namespace doppel {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Track = std::vector<std::optional<Vector3d>>;  ///< [F] metres

constexpr long kMaxMarkerFrames = 200'000;
constexpr double kMaxFilledSeconds = 0.5;  ///< seconds
constexpr std::size_t kMinJoints = 6;
/// Metres per radian: the rotations of a figure of points follow from its points, and only settle the twist.
constexpr double kRotationWeight = 0.01;
constexpr double kNoBone = 1e-6;  ///< metres; a shorter bone has no direction

/// Fills gaps between found points by straight lines. @return the number of points filled
long fill_gaps(Track& track, std::size_t longest) {
  long filled = 0;
  std::size_t before = track.size();
  for (std::size_t f = 0; f < track.size(); ++f) {
    if (!track[f]) continue;
    if (before < f && f - before - 1 <= longest)
      for (std::size_t gap = before + 1; gap < f; ++gap, ++filled) {
        const double share = static_cast<double>(gap - before) / static_cast<double>(f - before);
        track[gap] = Vector3d((1 - share) * *track[before] + share * *track[f]);
      }
    before = f;
  }
  return filled;
}

/// The first and the last found point stand still before and after them.
void hold_ends(Track& track) {
  const auto found = [](const auto& point) { return point.has_value(); };
  const auto first = std::find_if(track.begin(), track.end(), found);
  const auto last = std::find_if(track.rbegin(), track.rend(), found);
  if (first == track.end()) return;
  std::fill(track.begin(), first, *first);
  std::fill(track.rbegin(), last, *last);
}

Vector3d rest_position(const std::string& name) {
  // The pelvis of points is the middle of the hips, or of markers around it.
  if (name == "pelvis") return 0.5 * (rest_position("left_hip") + rest_position("right_hip"));
  std::string figure = name;
  if (name.ends_with("_toe")) figure = name.substr(0, name.size() - 3) + "foot";
  for (const FigureJoint& joint : rest_figure())
    if (joint.name == figure) return joint.position;
  fail("the figure has no joint '{}'", name);
}

/// A joint of the figure that is made of points.
struct PointJoint {
  std::string name;
  int parent = -1;  ///< PointJoint
  Track track;
  std::vector<int> children;
  Vector3d rest = Vector3d::Zero();  ///< position in the rest pose
};

class PointFigure {
 public:
  PointFigure(const SpacePoints& points, const MotionSourceOptions& options) : rate_(points.rate) {
    if (points.frames.empty()) fail("the file has no frames of points");
    if (!(rate_ > 0)) rate_ = options.frames_per_second;
    if (!(rate_ > 0)) fail("the file states no frame rate; give it with --source-fps");
    const long frames = points.frames.rbegin()->first - points.frames.begin()->first + 1;
    if (frames > kMaxMarkerFrames)
      fail("the frames {} to {} are more than {}, which is the most that are read", points.frames.begin()->first,
           points.frames.rbegin()->first, kMaxMarkerFrames);
    gather(points, options, as_size(frames));
    turn_upright(points, options);
    fill();
    build_rest();
  }

  SourceMotion motion() const {
    SourceMotion motion;
    motion.notes = notes_;
    motion.warnings = warnings_;
    motion.rotation_weight = kRotationWeight;
    motion.tracks.seconds_per_frame = 1.0 / rate_;
    for (const PointJoint& joint : joints_) {
      motion.tracks.names.push_back(joint.name);
      motion.tracks.parents.push_back(joint.parent);
      motion.tracks.rest.emplace_back(Eigen::Translation3d(joint.rest));
    }
    for (std::size_t f = 0; f < joints_[0].track.size(); ++f) motion.tracks.frames.push_back(pose(f));
    return motion;
  }

 private:
  MatchedMarkers chosen_person(const SpacePoints& points, const std::string& wanted);
  void gather(const SpacePoints& points, const MotionSourceOptions& options, std::size_t frames);
  void require_body(const SpacePoints& points) const;
  void turn_upright(const SpacePoints& points, const MotionSourceOptions& options);
  Vector3d mean_upward() const;
  void fill();
  void build_rest();
  std::vector<Eigen::Affine3d> pose(std::size_t frame) const;
  Matrix3d rotation(std::size_t joint, const std::vector<Vector3d>& positions, const Matrix3d& above) const;
  const PointJoint* find(const std::string& name) const {
    const auto found =
        std::find_if(joints_.begin(), joints_.end(), [&](const PointJoint& joint) { return joint.name == name; });
    return found == joints_.end() ? nullptr : &*found;
  }

  double rate_;
  std::vector<PointJoint> joints_;  ///< parents first
  std::vector<std::string> notes_, warnings_;
};

/// The points of the person that is wanted, else of the first who shows a body.
MatchedMarkers PointFigure::chosen_person(const SpacePoints& points, const std::string& wanted) {
  const std::vector<MarkerPerson> people = marker_people(points.names);
  std::vector<std::string> names;
  for (const MarkerPerson& person : people) names.push_back(person.name);
  auto chosen = std::find_if(people.begin(), people.end(), [&](const MarkerPerson& person) {
    return wanted.empty() ? person.markers.show_a_body() : person.name == wanted;
  });
  if (chosen == people.end() && !wanted.empty())
    fail<UsageError>("--person {}: the file has no points of this person; it has those of {}{}", wanted,
                     fmt::join(names, ", "), nearest_word_hint(wanted, names));
  if (chosen == people.end()) chosen = people.begin();
  if (wanted.empty() && people.size() > 1)
    warnings_.push_back(
        fmt::format("the file holds the points of {} people ({}); {} is taken, --person NAME takes another",
                    people.size(), fmt::join(names, ", "), chosen->name));
  return chosen->markers;
}

/// The means of the points that show each joint, where all of them are found.
void PointFigure::gather(const SpacePoints& points, const MotionSourceOptions& options, std::size_t frames) {
  const MatchedMarkers person = chosen_person(points, options.person);
  const auto& matched = person.points;
  std::array<int, kMarkerJoints.size()> joint_of{};
  joint_of.fill(-1);
  for (std::size_t j = 0; j < kMarkerJoints.size(); ++j) {
    PointJoint joint{kMarkerJoints[j].name, -1, Track(frames), {}, {}};
    bool seen = false;
    for (const auto& [frame, row] : points.frames) {
      Vector3d sum = Vector3d::Zero();
      bool all = !matched[j].empty();
      for (const int point : matched[j]) {
        all = all && row[point];
        if (all) sum += *row[point];
      }
      if (all) joint.track[frame - points.frames.begin()->first] = Vector3d(sum / matched[j].size());
      seen = seen || all;
    }
    if (!seen) continue;
    for (int above = kMarkerJoints[j].parent; above >= 0 && joint.parent < 0; above = kMarkerJoints[above].parent)
      joint.parent = joint_of[above];
    joint_of[j] = static_cast<int>(joints_.size());
    if (joint.parent >= 0) joints_[joint.parent].children.push_back(joint_of[j]);
    joints_.push_back(std::move(joint));
  }
  require_body(points);
  if (person.on_skin)
    notes_.push_back(
        "knees, ankles, shoulders or elbows are markers on the skin, not centres of joints: the directions of the "
        "limbs "
        "are a few degrees off");
}

void PointFigure::require_body(const SpacePoints& points) const {
  const bool knee = find("left_knee") || find("right_knee");
  if (find("pelvis") && knee && joints_.size() >= kMinJoints) return;
  std::vector<std::string> found;
  for (const PointJoint& joint : joints_) found.push_back(joint.name);
  fail(
      "the points show too little of a body: {} of {} joints ({}); needed are the pelvis or both hips, a knee and four "
      "more. The file has the points {}",
      found.size(), kMarkerJoints.size(), found.empty() ? "none" : fmt::format("{}", fmt::join(found, ", ")),
      fmt::join(points.names.begin(),
                points.names.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(points.names.size(), 80)),
                " "));
}

/// The mean of the directions, of length 1, from the joints of the legs to those of the trunk, where both are found.
Vector3d PointFigure::mean_upward() const {
  Vector3d sum = Vector3d::Zero();
  int count = 0;
  for (const char* top : {"neck", "head", "pelvis"})
    for (const char* foot : {"left_ankle", "right_ankle", "left_knee", "right_knee"}) {
      const PointJoint *high = find(top), *low = find(foot);
      for (std::size_t f = 0; high && low && f < high->track.size(); ++f)
        if (high->track[f] && low->track[f]) {
          sum += (*high->track[f] - *low->track[f]).normalized();
          ++count;
        }
    }
  return count > 0 ? Vector3d(sum / count) : sum;
}

/// What states the vertical, the file or its format, is right for people who lie or stand on their hands. The body is
/// asked where nothing does.
void PointFigure::turn_upright(const SpacePoints& points, const MotionSourceOptions& options) {
  const Vector3d upward = mean_upward();
  Vector3d up = nearest_axis(upward).axis;
  if (options.up) {
    up = Vector3d::Unit(*options.up - 'x');
  } else {
    std::string reason;
    if (points.up) {
      up = *points.up;
      reason = "as the file says (POINT:Y_SCREEN)";
    } else if (points.format == "trc") {
      up = Vector3d::UnitY();
      reason = "as usual in TRC files";
    } else {
      reason = "as the body stands";
    }
    notes_.push_back(fmt::format("{} is taken as the vertical, {}", axis_name(up), reason));
    if (const auto lying = not_upright(upward, up, reason)) warnings_.push_back(*lying);
  }
  const Matrix3d turn = y_up_from_axis(up);
  for (PointJoint& joint : joints_)
    for (auto& point : joint.track)
      if (point) point = Vector3d(turn * *point);
}

void PointFigure::fill() {
  long filled = 0;
  for (PointJoint& joint : joints_) {
    const bool root = joint.parent < 0;
    const double longest = root ? static_cast<double>(joint.track.size()) : std::floor(kMaxFilledSeconds * rate_);
    filled += fill_gaps(joint.track, as_size(longest));
    if (root) hold_ends(joint.track);
  }
  if (filled > 0)
    notes_.push_back(fmt::format(
        "{} positions of joints were missing for a short time and are filled in by straight lines", filled));
}

/// The T-pose with the median lengths of the bones, standing on the floor.
void PointFigure::build_rest() {
  double lowest = HUGE_VAL;
  for (PointJoint& joint : joints_) {
    if (joint.parent >= 0) {
      const PointJoint& above = joints_[joint.parent];
      std::vector<double> lengths;
      for (std::size_t f = 0; f < joint.track.size(); ++f)
        if (joint.track[f] && above.track[f]) lengths.push_back((*joint.track[f] - *above.track[f]).norm());
      const Vector3d way = rest_position(joint.name) - rest_position(above.name);
      double length = way.norm();
      if (!lengths.empty()) {
        const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
        std::nth_element(lengths.begin(), middle, lengths.end());
        length = *middle;
      }
      joint.rest = above.rest + length * way.normalized();
    }
    lowest = std::min(lowest, joint.rest.y());
  }
  for (PointJoint& joint : joints_) joint.rest.y() -= lowest;
}

/// World from joint. A joint without a point keeps its rest position in the joint above.
std::vector<Eigen::Affine3d> PointFigure::pose(std::size_t frame) const {
  std::vector<Vector3d> positions;
  for (const PointJoint& joint : joints_) positions.push_back(joint.track[frame].value_or(Vector3d::Constant(NAN)));
  std::vector<Eigen::Affine3d> world;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const PointJoint& joint = joints_[j];
    const Matrix3d above = joint.parent < 0 ? Matrix3d::Identity() : Matrix3d(world[joint.parent].linear());
    if (positions[j].hasNaN())
      positions[j] = positions[joint.parent] + above * (joint.rest - joints_[joint.parent].rest);
    world.emplace_back(Eigen::Translation3d(positions[j]));
    world.back().linear() = rotation(j, positions, above);
  }
  return world;
}

/// The rotation of a joint since the rest pose, by its bones to the joints below whose points are found.
Matrix3d PointFigure::rotation(std::size_t index, const std::vector<Vector3d>& positions, const Matrix3d& above) const {
  const PointJoint& joint = joints_[index];
  Eigen::Matrix3Xd from(3, 0), to(3, 0);
  const auto add = [&](const Vector3d& rest, const Vector3d& now) {
    from.conservativeResize(3, from.cols() + 1);
    to.conservativeResize(3, to.cols() + 1);
    from.rightCols(1) = rest;
    to.rightCols(1) = now;
  };
  const auto direction = [&](int a, int b) -> Vector3d { return (positions[b] - positions[a]).normalized(); };
  int below = -1;
  for (const int child : joint.children) {
    if (positions[child].hasNaN()) continue;
    const Vector3d bone = joints_[child].rest - joint.rest;
    const Vector3d now = direction(static_cast<int>(index), child);
    if (bone.norm() < kNoBone || now.isZero()) continue;
    add(bone, bone.norm() * now);
    below = child;
  }
  if (from.cols() == 0) return above;
  if (from.cols() > 1) return best_rotation(from, to);
  const Matrix3d swing = rotation_between(above * from.col(0), to.col(0)).toRotationMatrix() * above;
  const std::vector<int>& next = joints_[below].children;
  const bool thigh = joints_[below].name.ends_with("_knee");
  const bool limb = thigh || joints_[below].name.ends_with("_elbow");
  if (!limb || next.empty() || positions[next[0]].hasNaN()) return swing;
  // The axis of a bent knee or elbow, whose rest axis is that of a bend from the T-pose.
  const Vector3d now = direction(static_cast<int>(index), below).cross(direction(below, next[0]));
  const Vector3d bend(0, 0, thigh ? -1 : 1);
  const Vector3d axis = from.col(0).normalized().cross(bend).normalized();
  constexpr double kStraight = 0.05;  // weight of the twist of the joint above: that of a bend by 13 degrees
  add(axis, now.norm() * now);
  add(axis, kStraight * (swing * axis));
  return best_rotation(from, to);
}

}  // namespace

SourceMotion motion_of_points(const SpacePoints& points, const MotionSourceOptions& options) {
  return PointFigure(points, options).motion();
}

SourceMotion read_marker_motion(const std::filesystem::path& path, const MotionSourceOptions& options) {
  const SpacePoints points = read_space_points(path, options.metres_per_unit);
  try {
    return motion_of_points(points, options);
  } catch (const FileError&) {
    throw;
  } catch (const UsageError& error) {
    fail<UsageError>("{}: {}", path.string(), error.what());
  } catch (const Error& error) {
    fail_at({path.string()}, "{}", error.what());
  }
}

}  // namespace doppel
