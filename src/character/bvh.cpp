#include "doppel/character/bvh.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "doppel/core/angles.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/geometry/file_space.h"

namespace doppel {
namespace {

using Eigen::Affine3d;
using Eigen::Vector3d;

int axis_of(BvhChannel channel) { return static_cast<int>(channel) % 3; }

/// A run of single axes that moves as one joint.
struct Run {
  std::string name;
  int first = 0, last = 0;  ///< joints of the skeleton
  int parent = -1;          ///< run
  bool slides = false, turns = false;
  int children = 0;
};

/// Whether joint `j` continues the run that ends with its parent: same bone, same position, and no other child.
bool continues(const Skeleton& skeleton, int j) {
  const Joint& joint = skeleton.joints[j];
  if (joint.parent < 0 || !joint.offset.isZero(1e-12)) return false;
  if (bone_name(joint.name) != bone_name(skeleton.joints[joint.parent].name)) return false;
  return std::count_if(skeleton.joints.begin(), skeleton.joints.end(),
                       [&](const Joint& other) { return other.parent == joint.parent; }) == 1;
}

std::vector<bool> driven_joints(const Skeleton& skeleton) {
  std::vector<bool> driven(skeleton.joints.size(), false);
  for (const Dof& dof : skeleton.dofs)
    for (const Dof::Drive& drive : dof.joints) driven[drive.joint] = true;
  return driven;
}

std::vector<Run> find_runs(const Skeleton& skeleton) {
  const std::vector<bool> driven = driven_joints(skeleton);
  std::vector<Run> runs;
  std::vector<int> run_of(skeleton.joints.size(), -1);
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const auto at = as_size(j);
    const Joint& joint = skeleton.joints[at];
    const int parent = joint.parent < 0 ? -1 : run_of[joint.parent];
    if (continues(skeleton, j)) {
      run_of[at] = parent;
    } else {
      run_of[at] = static_cast<int>(runs.size());
      const bool taken =
          std::any_of(runs.begin(), runs.end(), [&](const Run& other) { return other.name == bone_name(joint.name); });
      runs.push_back({taken ? joint.name : bone_name(joint.name), j, j, parent});
    }
    Run& run = runs[run_of[at]];
    run.last = j;
    if (driven[at]) (joint.type == Joint::Type::prismatic ? run.slides : run.turns) = true;
  }
  for (const Run& run : runs)
    if (run.parent >= 0) ++runs[run.parent].children;
  return runs;
}

/// Whether a run has no moving joint and is the only end of a chain.
bool is_end_site(const std::vector<Run>& runs, const Run& run) {
  return run.parent >= 0 && !run.slides && !run.turns && run.children == 0 && runs[run.parent].children == 1;
}

/// Of the two triples (z, x, y) with R = Rz Rx Ry in [-pi, pi], the one nearer to `previous`, plus multiples of 2 pi.
std::array<double, 3> zxy_angles(const Eigen::Matrix3d& R, const std::array<double, 3>& previous) {
  const double x = std::asin(std::clamp(R(2, 1), -1.0, 1.0));
  std::array<std::array<double, 3>, 2> triples;
  if (std::abs(R(2, 1)) < 1.0 - 1e-9) {
    const double z = std::atan2(-R(0, 1), R(1, 1)), y = std::atan2(-R(2, 0), R(2, 2));
    triples = {{{z, x, y}, {z + kPi, kPi - x, y + kPi}}};
  } else {
    // Only z + y (or z - y) is determined: y keeps its value.
    const double both = std::atan2(R(1, 0), R(0, 0));
    const double z = x > 0 ? both - previous[2] : both + previous[2];
    triples = {{{z, x, previous[2]}, {z, x, previous[2]}}};
  }
  double nearest = HUGE_VAL;
  std::array<double, 3> chosen{};
  for (std::array<double, 3> triple : triples) {
    double distance = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      triple[i] += 2 * kPi * std::round((previous[i] - triple[i]) / (2 * kPi));
      distance += std::abs(triple[i] - previous[i]);
    }
    if (distance < nearest) {
      nearest = distance;
      chosen = triple;
    }
  }
  return chosen;
}

/// The transforms of the runs, with frames rotated so that the rest pose has no rotation, as BVH requires.
class RestAsZero {
 public:
  RestAsZero(const std::vector<Run>& runs, std::vector<Affine3d> rest) : runs_(runs), rest_(std::move(rest)) {}

  /// Parent-from-run in one pose. Runs without a parent: world-from-run.
  Affine3d local(const Run& run, const std::vector<Affine3d>& world) const {
    if (run.parent < 0) return turned(run, world);
    return turned(runs_[run.parent], world).inverse(Eigen::Isometry) * turned(run, world);
  }
  Vector3d offset(const Run& run) const { return local(run, rest_).translation(); }

 private:
  Affine3d turned(const Run& run, const std::vector<Affine3d>& world) const {
    Affine3d transform = world[run.last];
    transform.linear() = transform.linear() * rest_[run.last].linear().transpose();
    return transform;
  }
  const std::vector<Run>& runs_;
  std::vector<Affine3d> rest_;
};

}  // namespace

int BvhClip::num_channels() const {
  std::size_t count = 0;
  for (const BvhJoint& joint : joints) count += joint.channels.size();
  return static_cast<int>(count);
}

std::vector<Affine3d> BvhClip::pose(const std::vector<double>& row) const {
  if (static_cast<int>(row.size()) != num_channels())
    fail("a frame of this BVH clip has {} channels, received {}", num_channels(), row.size());
  std::vector<Affine3d> world_from_joint;
  auto value = row.begin();
  for (const BvhJoint& joint : joints) {
    Vector3d position = joint.offset;
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    for (const BvhChannel channel : joint.channels) {
      if (is_position(channel))
        position[axis_of(channel)] = *value++;
      else
        turn = turn * Eigen::AngleAxisd(*value++, Vector3d::Unit(axis_of(channel)));
    }
    Affine3d local = Affine3d::Identity();
    local.linear() = turn;
    local.translation() = position;
    world_from_joint.push_back(joint.parent < 0 ? local : world_from_joint[joint.parent] * local);
  }
  return world_from_joint;
}

BvhClip bvh_from_motion(const Skeleton& skeleton, const Motion& motion, double frames_per_second,
                        const std::vector<double>& rest_dofs) {
  using Channel = BvhChannel;
  const std::vector<Run> runs = find_runs(skeleton);
  const RestAsZero poses(runs,
                         skeleton.pose(rest_dofs.empty() ? std::vector<double>(skeleton.dofs.size(), 0.0) : rest_dofs));
  BvhClip clip;
  clip.seconds_per_frame = 1.0 / frames_per_second;
  for (const Run& run : runs) {
    BvhJoint joint{run.name, run.parent, poses.offset(run), {}};
    // Some readers add a root's offset to its positions, others replace the offset by them. Both agree for offset 0.
    if (run.parent < 0) joint.offset.setZero();
    if (run.parent < 0 || run.slides) joint.channels = {Channel::x_position, Channel::y_position, Channel::z_position};
    if (is_end_site(runs, run))
      joint.name = clip.joints[run.parent].name + "_end";
    else
      joint.channels.insert(joint.channels.end(), {Channel::z_rotation, Channel::x_rotation, Channel::y_rotation});
    clip.joints.push_back(joint);
  }
  std::vector<std::array<double, 3>> previous(runs.size(), std::array<double, 3>{});
  for (const std::vector<double>& dofs : motion.frames) {
    const std::vector<Affine3d> world = skeleton.pose(dofs);
    std::vector<double> row;
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const Affine3d local = poses.local(runs[r], world);
      if (clip.joints[r].channels.size() == 6)
        row.insert(row.end(), local.translation().data(), local.translation().data() + 3);
      if (clip.joints[r].channels.empty()) continue;
      previous[r] = zxy_angles(local.linear(), previous[r]);
      row.insert(row.end(), previous[r].begin(), previous[r].end());
    }
    clip.frames.push_back(row);
  }
  return clip;
}

BvhClip with_z_up(BvhClip clip) {
  using enum BvhChannel;
  constexpr std::array kTurned{x_position, z_position, y_position, x_rotation, z_rotation, y_rotation};
  std::size_t column = 0;
  for (BvhJoint& joint : clip.joints) {
    joint.offset = FileSpace{1.0, true}.of(joint.offset);
    for (BvhChannel& channel : joint.channels) {
      if (channel == BvhChannel::z_position || channel == BvhChannel::z_rotation)
        for (std::vector<double>& row : clip.frames) row[column] = 0.0 - row[column];  // the file would show -0
      channel = kTurned[static_cast<std::size_t>(channel)];
      ++column;
    }
  }
  return clip;
}

JointTracks joint_tracks(const BvhClip& clip) {
  JointTracks tracks;
  std::vector<double> rest_row;
  for (const BvhJoint& joint : clip.joints) {
    tracks.names.push_back(joint.name);
    tracks.parents.push_back(joint.parent);
    for (const BvhChannel channel : joint.channels)
      rest_row.push_back(is_position(channel) ? joint.offset[axis_of(channel)] : 0.0);
  }
  tracks.rest = clip.pose(rest_row);
  for (const std::vector<double>& row : clip.frames) tracks.frames.push_back(clip.pose(row));
  tracks.seconds_per_frame = clip.seconds_per_frame;
  return tracks;
}

}  // namespace doppel
