#include "doppel/io/motion_import/smpl_motion.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "doppel/core/angles.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"
#include "doppel/geometry/up_axis.h"
#include "doppel/io/motion_import/npz_file.h"
#include "doppel/io/motion_import/rest_figure.h"
#include "doppel/io/motion_import/vertical.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

constexpr std::size_t kMaxSmplFrames = 200'000;
/// Cosine from which the trunk counts as upright on average.
constexpr double kUpright = 0.7;

/// Rows of numbers of an array with T rows.
struct Rows {
  std::size_t frames = 0, width = 0;
  std::vector<double> values;

  Vector3d vector(std::size_t frame, std::size_t item) const {
    return Vector3d::Map(values.data() + frame * width + 3 * item);
  }
};

Rows read_rows(const NpzFile& file, const std::string& name) {
  const NpyArray array = file.read(name);
  if (array.shape.size() < 2 || array.shape.size() > 3 || (array.shape.size() == 3 && array.shape[2] != 3))
    fail_at(file.where(),
            "'{}' has the shape ({}); expected are frames and numbers, or frames, joints and 3 (axis-angles)", name,
            fmt::join(array.shape, ", "));
  Rows rows;
  rows.frames = as_size(array.shape[0]);
  if (rows.frames == 0 || rows.frames > kMaxSmplFrames)
    fail_at(file.where(), "'{}' has {} frames; 1 to {} are read", name, rows.frames, kMaxSmplFrames);
  constexpr std::int64_t kMaxWidth = 1000;
  if (array.size() / array.shape[0] > kMaxWidth)
    fail_at(file.where(), "'{}' has {} numbers in a frame; at most {} are read", name, array.size() / array.shape[0],
            kMaxWidth);
  rows.values = array.as<double>();
  rows.width = rows.values.size() / rows.frames;
  const auto bad = std::find_if(rows.values.begin(), rows.values.end(), [](double x) { return !std::isfinite(x); });
  if (bad != rows.values.end())
    fail_at(file.where(), "'{}' holds {} in frame {}; every number must be finite", name, *bad,
            as_size(bad - rows.values.begin()) / rows.width);
  return rows;
}

/// Two arrays side by side.
Rows joined(const Rows& left, const Rows& right, const NpzFile& file) {
  if (left.frames != right.frames)
    fail_at(file.where(), "the rotation of the root has {} frames, the body {}", left.frames, right.frames);
  Rows rows{left.frames, left.width + right.width, {}};
  for (std::size_t f = 0; f < left.frames; ++f)
    for (const Rows* part : {&left, &right}) {
      const auto begin = part->values.begin() + static_cast<std::ptrdiff_t>(f * part->width);
      rows.values.insert(rows.values.end(), begin, begin + static_cast<std::ptrdiff_t>(part->width));
    }
  return rows;
}

/// Joints of the models: the body alone, SMPL, SMPL-H and SMPL-X.
constexpr std::array<std::size_t, 4> kModelJoints{22, 24, 52, 55};

/// Rows of 6 numbers, quaternions or matrices in a row are as long as those of no model, so the length tells them
/// apart.
void require_smpl_width(const NpzFile& file, std::size_t width) {
  std::string guess;
  for (const std::size_t joints : kModelJoints) {
    if (width == 3 * joints) return;
    for (const auto& [numbers, form] :
         {std::pair<std::size_t, const char*>{6, "the 6 numbers of two columns"}, {4, "quaternions"}, {9, "matrices"}})
      if (width == numbers * joints) guess = fmt::format(" They seem to be {} of {} joints.", form, joints);
  }
  fail_at(file.where(),
          "has {} numbers of pose in a frame, which is no body of SMPL; those have 66 (the body), 72 (SMPL), 156 "
          "(SMPL-H) or 165 (SMPL-X): axis and angle of each joint, radians.{} Convert them to axis-angles (scipy: "
          "Rotation.as_rotvec)",
          width, guess);
}

/// A joint of a body turns by less than a whole turn relative to the joint above. Only the root may turn further.
void require_radians(const NpzFile& file, const Rows& poses) {
  constexpr std::size_t kFewJoints = 3;
  std::size_t beyond = 0;
  double largest = 0.0;
  for (std::size_t j = 1; j < rest_figure().size(); ++j) {
    double sum = 0.0;
    for (std::size_t f = 0; f < poses.frames; ++f) {
      sum += poses.vector(f, j).norm() / static_cast<double>(poses.frames);
      largest = std::max(largest, poses.vector(f, j).norm());
    }
    if (sum > 2 * kPi) ++beyond;
  }
  if (beyond >= kFewJoints)
    fail_at(file.where(),
            "has angles up to {:.4g}, and {} of {} joints of the body turn by more than a whole turn (6.28 radians) on "
            "average: these are no radians, perhaps degrees. Multiply the poses by pi / 180",
            largest, beyond, rest_figure().size() - 1);
}

Rows read_poses(const NpzFile& file) {
  Rows poses;
  if (file.has("poses"))
    poses = read_rows(file, "poses");
  else if (file.has("root_orient") && file.has("pose_body"))
    poses = joined(read_rows(file, "root_orient"), read_rows(file, "pose_body"), file);
  else if (file.has("global_orient") && file.has("body_pose"))
    poses = joined(read_rows(file, "global_orient"), read_rows(file, "body_pose"), file);
  else
    fail_at(file.where(), "holds no motion of a body: neither 'poses' nor 'root_orient' and 'pose_body'. It has: {}",
            excerpt(fmt::format("{}", fmt::join(file.names(), ", ")), 500));
  require_smpl_width(file, poses.width);
  require_radians(file, poses);
  return poses;
}

Rows read_translations(const NpzFile& file, std::size_t frames, std::vector<std::string>& notes) {
  const std::string name = file.has("trans") ? "trans" : "transl";
  if (!file.has(name)) {
    notes.push_back("the file has no 'trans', so the body stays in place");
    return {frames, 3, std::vector<double>(3 * frames, 0.0)};
  }
  Rows translations = read_rows(file, name);
  if (translations.frames != frames || translations.width != 3)
    fail_at(file.where(), "'{}' has {} rows of {} numbers; the poses need {} rows of 3", name, translations.frames,
            translations.width, frames);
  for (const double x : translations.values)
    if (std::abs(x) > 1e5) fail_at(file.where(), "'{}' holds {} m; a body within 100 km is expected", name, x);
  return translations;
}

double read_rate(const NpzFile& file, double given) {
  if (given > 0) return given;
  for (const char* name : {"mocap_framerate", "mocap_frame_rate", "frame_rate", "fps"}) {
    if (!file.has(name)) continue;
    const std::vector<double> rate = file.read(name).as<double>();
    if (rate.size() != 1 || !(rate[0] > 0.0 && rate[0] <= 1000.0))
      fail_at(file.where(), "'{}' is {}; one number of frames per second above 0 and up to 1000 is expected", name,
              fmt::join(rate, ", "));
    return rate[0];
  }
  fail_at(file.where(),
          "states no frame rate ('mocap_framerate', 'mocap_frame_rate', 'frame_rate' or 'fps'); give it with "
          "--source-fps");
}

/// World from joint of one frame, in the file's axes.
std::vector<Eigen::Affine3d> posed_figure(const Rows& poses, std::size_t frame, const Vector3d& translation) {
  std::vector<Eigen::Affine3d> world;
  for (std::size_t j = 0; j < rest_figure().size(); ++j) {
    const FigureJoint& joint = rest_figure()[j];
    const Vector3d turn = poses.vector(frame, j);
    const double angle = turn.norm();
    const Eigen::Matrix3d rotation =
        Eigen::AngleAxisd(angle, angle > 0 ? Vector3d(turn / angle) : Vector3d::UnitX()).toRotationMatrix();
    Eigen::Affine3d local = Eigen::Affine3d::Identity();
    local.linear() = rotation;
    local.translation() = joint.parent < 0 ? translation : joint.position - rest_figure()[joint.parent].position;
    world.push_back(joint.parent < 0 ? local : world[joint.parent] * local);
  }
  return world;
}

/// Where the trunk points on average: the mean of directions of length 1.
Vector3d mean_trunk(const JointTracks& tracks) {
  constexpr std::size_t kNeck = 12;
  Vector3d sum = Vector3d::Zero();
  for (const auto& frame : tracks.frames) sum += (frame[kNeck].translation() - frame[0].translation()).normalized();
  return sum / static_cast<double>(tracks.num_frames());
}

/// Whether the arrays are named as in AMASS, whose rule is z up. Other programs write the same rotations in the axes of
/// their cameras, under other names.
bool is_amass(const NpzFile& file) {
  return file.has("trans") || file.has("mocap_framerate") || file.has("mocap_frame_rate");
}

void turn_upright(SourceMotion& motion, std::optional<char> up, bool amass) {
  const Vector3d trunk = mean_trunk(motion.tracks);
  Vector3d axis = Vector3d::UnitZ();
  if (up) {
    axis = Vector3d::Unit(*up - 'x');
  } else if (amass) {
    if (const auto lying = not_upright(trunk, axis, "as in AMASS")) motion.warnings.push_back(*lying);
  } else if (const NearestAxis nearest = nearest_axis(trunk); nearest.cosine > kUpright) {
    axis = nearest.axis;
    motion.notes.push_back(fmt::format("the trunk stands along {}, which is taken as the vertical", axis_name(axis)));
  } else {
    motion.notes.emplace_back("the trunk stands along no axis, so z is taken as the vertical, as in AMASS");
  }
  turn_to_y_up(motion.tracks, axis);
}

/// Moves the body vertically until its lowest joint, but for the lowest fiftieth of the frames, is as high as the joint
/// of a foot above its sole.
void stand_on_floor(JointTracks& tracks, std::vector<std::string>& notes) {
  constexpr double kMaxSoleHeight = 0.07;
  std::vector<double> lowest;
  for (const auto& frame : tracks.frames) {
    double low = HUGE_VAL;
    for (std::size_t j = 0; j < frame.size(); ++j)
      low = std::min(low, frame[j].translation().y() - std::min(rest_figure()[j].position.y(), kMaxSoleHeight));
    lowest.push_back(low);
  }
  const auto nth = lowest.begin() + static_cast<std::ptrdiff_t>(lowest.size() / 50);
  std::nth_element(lowest.begin(), nth, lowest.end());
  for (auto& frame : tracks.frames)
    for (Eigen::Affine3d& joint : frame) joint.translation().y() -= *nth;
  if (std::abs(*nth) > 0.01)
    notes.push_back(
        fmt::format("the body is moved by {:.2f} m along the vertical, so that it stands on the floor", -*nth));
}

}  // namespace

SourceMotion read_smpl_motion(const std::filesystem::path& path, const MotionSourceOptions& options) {
  const NpzFile file(path);
  const Rows poses = read_poses(file);
  SourceMotion motion;
  const Rows translations = read_translations(file, poses.frames, motion.notes);
  JointTracks& tracks = motion.tracks;
  tracks.seconds_per_frame = 1.0 / read_rate(file, options.frames_per_second);
  for (const FigureJoint& joint : rest_figure()) {
    tracks.names.emplace_back(joint.name);
    tracks.parents.push_back(joint.parent);
    tracks.rest.emplace_back(Eigen::Translation3d(joint.position));
  }
  for (std::size_t f = 0; f < poses.frames; ++f)
    tracks.frames.push_back(posed_figure(poses, f, translations.vector(f, 0)));
  turn_upright(motion, options.up, is_amass(file));
  stand_on_floor(tracks, motion.notes);
  return motion;
}

}  // namespace doppel
