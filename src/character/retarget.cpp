#include "doppel/character/retarget.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "doppel/character/mapped_joints.h"
#include "doppel/character/pose_solver.h"
#include "doppel/character/source_rest.h"
#include "doppel/core/angles.h"
#include "doppel/core/as_size.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/geometry/best_rotation.h"
#include "doppel/geometry/up_axis.h"

namespace doppel {
namespace {

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Metres per radian at most where the rest pose is found from the motion, whose twist of limbs is a guess.
constexpr double kFoundRotationWeight = 0.01;

/// One pair of the map, and what the two rest poses say about it.
struct Node : MappedJoint {
  Matrix3d joint_from_source = Matrix3d::Identity();  ///< C: the target's desired rotation is (the source's) * C
  Vector3d offset_from_parent = Vector3d::Zero();     ///< in the parent joint's frame, target's rest pose
};

/// Both skeletons in their rest poses, and the alignment between them.
class RestPoses {
 public:
  RestPoses(const std::vector<Affine3d>& target, const std::vector<Affine3d>& source, std::vector<Node>& nodes)
      : target_(target), source_(source), nodes_(nodes) {
    for (Node& node : nodes_) {
      if (node.parent < 0) continue;
      const Node& parent = nodes_[node.parent];
      node.offset_from_parent = target_[parent.target].inverse() * target_position(node);
    }
    const Matrix3d whole = alignment(all_bones(), Matrix3d::Identity());
    source_up_ = nearest_axis(whole.col(1)).axis;
    std::vector<Matrix3d> turns;
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
      Node& node = nodes_[n];
      // A joint without children has no bone of its own: it rotates like its parent.
      turns.push_back(node.end && node.parent >= 0 ? turns[node.parent]
                                                   : alignment(bones_of(static_cast<int>(n)), whole));
      const Matrix3d source_rest = node.rest_turn * source_[node.source].linear();
      node.joint_from_source = source_rest.transpose() * turns.back() * target_[node.target].linear();
    }
  }

  /// The height of the target's root above its feet minus the scaled height of the source's root, upwards in the
  /// source's rest pose. The roots need not be the same point of the body.
  Vector3d lift(double scale) const { return (hip_height(false) - scale * hip_height(true)) * source_up_; }

  /// The rotation of a node's source joint since its rest pose.
  Matrix3d source_turn(const Node& node, const std::vector<Affine3d>& frame) const {
    return frame[node.source].linear() * source_[node.source].linear().transpose() * node.rest_turn.transpose();
  }
  /// The source's rest bone that leads to a node, rotated by the map.
  Vector3d source_bone(const Node& node) const {
    const Node& parent = nodes_[node.parent];
    return parent.rest_turn * (source_position(node) - source_position(parent));
  }

  double scale(const JointMap& map) const {
    if (map.scale == JointMap::Scale::number) return map.factor;
    const bool height = map.scale == JointMap::Scale::hip_height;
    const double ours = height ? hip_height(false) : leg_length(false);
    const double theirs = height ? hip_height(true) : leg_length(true);
    if (ours < 0.05 || theirs < 0.05 || ours / theirs > 20.0 || theirs / ours > 20.0)
      fail_at(
          map.pairs.front().where,
          "the {} is {:.3g} m in the character's rest pose and {:.3g} m in the motion's: no scale can be found from "
          "these. Check the unit and that hips and feet are mapped, or give `scale:` as a number",
          height ? "height of the hips above the lowest mapped joint" : "leg", ours, theirs);
    return ours / theirs;
  }

 private:
  Vector3d target_position(const Node& node) const { return target_[node.target].translation(); }
  Vector3d source_position(const Node& node) const { return source_[node.source].translation(); }

  /// Bones, named by the node they lead to: those that begin at `parent`, or all.
  std::vector<std::size_t> bones_of(int parent) const {
    std::vector<std::size_t> bones;
    for (std::size_t n = 0; n < nodes_.size(); ++n)
      if (nodes_[n].parent == parent) bones.push_back(n);
    return bones;
  }
  std::vector<std::size_t> all_bones() const {
    std::vector<std::size_t> bones(nodes_.size() - 1);
    std::iota(bones.begin(), bones.end(), std::size_t{1});
    return bones;
  }

  /// A: rotates the target's rest pose so that its bones have the directions of the source's rest pose. A single bone
  /// does not determine the twist, which is then that of `usual`.
  Matrix3d alignment(const std::vector<std::size_t>& bones, const Matrix3d& usual) const {
    Eigen::Matrix3Xd from(3, 0), to(3, 0);
    for (const std::size_t n : bones) {
      const Node& node = nodes_[n];
      const Node& parent = nodes_[node.parent];
      const Vector3d ours = target_position(node) - target_position(parent),
                     theirs = source_position(node) - source_position(parent);
      if (ours.norm() < kNoBoneLength || theirs.norm() < kNoBoneLength) continue;
      from.conservativeResize(3, from.cols() + 1);
      to.conservativeResize(3, to.cols() + 1);
      from.rightCols(1) = ours;
      to.rightCols(1) = parent.rest_turn * theirs.normalized() * ours.norm();
    }
    if (from.cols() == 0) return usual;
    if (from.cols() == 1) return rotation_between(usual * from.col(0), to.col(0)).toRotationMatrix() * usual;
    return best_rotation(from, to);
  }

  Vector3d position_in(const Node& node, bool source) const {
    return source ? source_position(node) : target_position(node);
  }
  std::size_t lowest() const {
    std::size_t lowest = 0;
    for (std::size_t n = 0; n < nodes_.size(); ++n)
      if (target_position(nodes_[n]).y() < target_position(nodes_[lowest]).y()) lowest = n;
    return lowest;
  }
  double hip_height(bool source) const {
    const Vector3d way = position_in(nodes_[0], source) - position_in(nodes_[lowest()], source);
    return way.dot(source ? source_up_ : Vector3d::UnitY());
  }
  /// The length from the foot to the hip. The bone to the root is excluded, because the root may be anywhere in the
  /// trunk.
  double leg_length(bool source) const {
    double length = 0.0;
    for (std::size_t n = lowest(); nodes_[n].parent >= 0; n = as_size(nodes_[n].parent)) {
      if (nodes_[n].parent == 0 && length > 0.0) break;
      length += (position_in(nodes_[n], source) - position_in(nodes_[nodes_[n].parent], source)).norm();
    }
    return length;
  }

  const std::vector<Affine3d>& target_;
  const std::vector<Affine3d>& source_;
  std::vector<Node>& nodes_;
  Vector3d source_up_ = Vector3d::UnitY();  ///< the axis along which the source's rest pose stands
};

/// The scaled source of one frame (retarget.h): the desired position and rotation of every node.
std::vector<PoseGoal> goals_of(const std::vector<Node>& nodes, const std::vector<Affine3d>& frame,
                               const RestPoses& rest, double scale, const RetargetOptions& options) {
  std::vector<PoseGoal> goals;
  for (const Node& node : nodes) {
    const Affine3d& source = frame[node.source];
    PoseGoal goal;
    goal.joint = node.target;
    goal.rotation = source.linear() * node.joint_from_source;
    goal.rotation_weight = options.rotation_weight;
    goal.position_weight = node.end ? options.end_weight : 1.0;
    if (node.parent < 0) {
      goal.position = scale * source.translation() + rest.source_turn(node, frame) * rest.lift(scale);
    } else {
      const Node& parent = nodes[node.parent];
      const PoseGoal& above = goals[node.parent];
      const Vector3d ours = above.rotation * node.offset_from_parent;
      const Vector3d theirs = rest.source_turn(parent, frame) * rest.source_bone(node);
      const Vector3d now = source.translation() - frame[parent.source].translation();
      // A source bone without length has no direction: the joint follows its parent.
      const bool rides = now.norm() < kNoBoneLength || theirs.norm() < kNoBoneLength;
      goal.position = above.position + (rides ? ours : Vector3d(rotation_between(theirs, now) * ours));
    }
    goals.push_back(goal);
  }
  return goals;
}

/// Initial poses when there is no previous frame: the rest pose with four headings and the desired root position.
std::vector<std::vector<double>> starts(const Skeleton& skeleton, const std::vector<double>& rest,
                                        const PoseGoal& root_goal) {
  Skeleton::Root root;
  try {
    root = skeleton.root();
  } catch (const Error&) {
    return {rest};  // a root of another structure: the rest pose is the only start
  }
  const auto vertical = as_size(std::find(root.axes.begin(), root.axes.end(), 1) - root.axes.begin());
  const auto heading = as_size(root.rotation[vertical]);
  std::vector<std::vector<double>> all;
  for (int quarter = 0; quarter < 4; ++quarter) {
    std::vector<double> dofs = rest;
    dofs[heading] += 0.5 * kPi * quarter / root.rotation_weight[vertical];
    const Vector3d way = root_goal.position - skeleton.pose(dofs)[root_goal.joint].translation();
    for (std::size_t axis = 0; axis < 3; ++axis)
      dofs[root.translation[axis]] += way[static_cast<int>(axis)] / root.translation_weight[axis];
    all.push_back(dofs);
  }
  return all;
}

JointTracks with_y_up(const JointTracks& source, const JointMap& map) {
  if (!map.z_up.value_or(false)) return source;
  const Affine3d up(Eigen::AngleAxisd(-kPi / 2, Vector3d::UnitX()));
  JointTracks turned = source;
  for (Affine3d& joint : turned.rest) joint = up * joint;
  for (auto& frame : turned.frames)
    for (Affine3d& joint : frame) joint = up * joint;
  return turned;
}

void add_distances(const Skeleton& skeleton, const std::vector<double>& dofs, const std::vector<PoseGoal>& goals,
                   std::vector<RetargetResult::Track>& tracks, int frames) {
  const std::vector<Affine3d> world = skeleton.pose(dofs);
  for (std::size_t n = 0; n < goals.size(); ++n) {
    const double distance = (world[goals[n].joint].translation() - goals[n].position).norm();
    tracks[n].mean_distance += distance / frames;
    tracks[n].largest_distance = std::max(tracks[n].largest_distance, distance);
  }
}

/// The direction from the feet to the head in a pose of the source, length 1, or 0 for a body without extent: where the
/// heights in the character's rest pose increase.
Vector3d upward(const std::vector<MappedJoint>& joints, const std::vector<Affine3d>& target_rest,
                const std::vector<Affine3d>& pose) {
  double mean_height = 0.0;
  for (const MappedJoint& joint : joints)
    mean_height += target_rest[joint.target].translation().y() / static_cast<double>(joints.size());
  Vector3d sum = Vector3d::Zero();
  for (const MappedJoint& joint : joints)
    sum += (target_rest[joint.target].translation().y() - mean_height) * pose[joint.source].translation();
  return sum.norm() > 0 ? Vector3d(sum.normalized()) : Vector3d(Vector3d::Zero());
}

}  // namespace

SourceStance source_stance(const Skeleton& skeleton, const std::vector<double>& rest_dofs, const JointTracks& source,
                           const JointMap& map) {
  const std::vector<MappedJoint> joints = mapped_joints(skeleton, source, map);
  const std::vector<Affine3d> rest = skeleton.pose(rest_dofs);
  SourceStance stance;
  if (is_pose_of_body(joints, rest, source.rest)) stance.rest = upward(joints, rest, source.rest);
  for (const std::vector<Affine3d>& frame : source.frames)
    stance.motion += upward(joints, rest, frame) / static_cast<double>(source.num_frames());
  return stance;
}

RetargetResult retarget(const Skeleton& skeleton, const JointTracks& given, const JointMap& map,
                        const RetargetOptions& options) {
  JointTracks source = with_y_up(resample(given, options.frames_per_second), map);
  std::vector<double> rest =
      options.rest_dofs.empty() ? std::vector<double>(skeleton.dofs.size(), 0.0) : options.rest_dofs;
  const std::vector<MappedJoint> mapped = mapped_joints(skeleton, source, map);
  const std::vector<Affine3d> rest_pose = skeleton.pose(rest);
  RetargetResult result;
  RetargetOptions used = options;
  if (!is_pose_of_body(mapped, rest_pose, source.rest)) {
    source.rest = rest_from_motion(mapped, rest_pose, source);
    result.rest_from_motion = true;
    used.rotation_weight = std::min(used.rotation_weight, kFoundRotationWeight);
  }
  std::vector<Node> nodes;
  for (const MappedJoint& joint : mapped) nodes.push_back({joint});
  const RestPoses rests(rest_pose, source.rest, nodes);
  result.scale = rests.scale(map);
  for (const Node& node : nodes)
    result.tracks.push_back(
        {skeleton.joints[node.target].name, source.names[node.source], node.target, node.end, 0.0, 0.0});

  PoseSolver solver(skeleton, options.iterations);
  std::vector<double> dofs = rest;
  for (int f = 0; f < source.num_frames(); ++f) {
    const auto goals = goals_of(nodes, source.frames[f], rests, result.scale, used);
    double cost = HUGE_VAL;
    if (f > 0) cost = solver.solve(goals, dofs);
    // After a jump in the source the previous frame can be too far away to be a start.
    constexpr double kLost = 0.1;  // metres, root mean square
    if (f == 0 || solver.mean_distance(goals, dofs) > kLost)
      for (std::vector<double> start : starts(skeleton, rest, goals.front()))
        if (const double found = solver.solve(goals, start); found < cost) {
          cost = found;
          dofs = start;
        }
    result.motion.frames.push_back(dofs);
    result.motion.ids.push_back(f);
    result.goals.emplace_back();
    for (const PoseGoal& goal : goals) result.goals.back().push_back(goal.position);
    add_distances(skeleton, dofs, goals, result.tracks, source.num_frames());
  }
  return result;
}

}  // namespace doppel
