#include "doppel/character/retarget.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "doppel/character/pose_solver.h"
#include "doppel/core/angles.h"
#include "doppel/core/as_size.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/geometry/best_rotation.h"

namespace doppel {
namespace {

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kNoLength = 1e-4;  // metres; a shorter bone has no direction

/// One pair of the map, resolved.
struct Node {
  int target = 0, source = 0;
  int parent = -1;  ///< node
  bool end = true;
  Matrix3d rest_turn = Matrix3d::Identity();          ///< rotation of the source's rest pose by the map
  Matrix3d joint_from_source = Matrix3d::Identity();  ///< C: the target's desired rotation is (the source's) * C
  Vector3d offset_from_parent = Vector3d::Zero();     ///< in the parent joint's frame, target's rest pose
};

/// The joint of this name, else the last joint of the bone of this name.
int find_joint(const std::vector<std::string>& joints, const std::string& name, const FileLocation& where,
               const char* whose) {
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (joints[j] == name) return static_cast<int>(j);
  for (std::size_t j = joints.size(); j-- > 0;)
    if (bone_name(joints[j]) == name) return static_cast<int>(j);
  std::vector<std::string> known = joints;
  for (const std::string& joint : joints) known.push_back(bone_name(joint));
  fail_at(where, "the {} has no joint '{}'; the joints are {}{}", whose, name, fmt::join(joints, ", "),
          nearest_word_hint(name, known));
}

/// The nearest node above joint `target`, or -1.
int node_above(const Skeleton& skeleton, const std::vector<Node>& nodes, int target) {
  for (int j = skeleton.joints[target].parent; j >= 0; j = skeleton.joints[j].parent)
    for (std::size_t n = 0; n < nodes.size(); ++n)
      if (nodes[n].target == j) return static_cast<int>(n);
  return -1;
}

std::vector<Node> resolve(const Skeleton& skeleton, const JointTracks& source, const JointMap& map) {
  std::vector<std::string> targets;
  for (const Joint& joint : skeleton.joints) targets.push_back(joint.name);
  std::vector<Node> nodes;
  for (const JointMap::Pair& pair : map.pairs) {
    Node node;
    node.target = find_joint(targets, pair.target, pair.where, "character");
    node.source = find_joint(source.names, pair.source, pair.where, "motion's skeleton");
    node.rest_turn = (Eigen::AngleAxisd(pair.rest_rotation.z(), Vector3d::UnitZ()) *
                      Eigen::AngleAxisd(pair.rest_rotation.y(), Vector3d::UnitY()) *
                      Eigen::AngleAxisd(pair.rest_rotation.x(), Vector3d::UnitX()))
                         .toRotationMatrix();
    for (const Node& other : nodes)
      if (other.target == node.target)
        fail_at(pair.where, "the character's joint '{}' is mapped twice", skeleton.joints[node.target].name);
    nodes.push_back(node);
  }
  std::sort(nodes.begin(), nodes.end(), [](const Node& a, const Node& b) { return a.target < b.target; });
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    nodes[n].parent = node_above(skeleton, nodes, nodes[n].target);
    if (nodes[n].parent >= 0) nodes[nodes[n].parent].end = false;
    if (n > 0 && nodes[n].parent < 0)
      fail_at(map.pairs.front().where,
              "the map has two roots, '{}' and '{}': no mapped joint lies above either. Map a joint above both, "
              "such as `Root: Hips`",
              targets[nodes[0].target], targets[nodes[n].target]);
  }
  if (nodes.size() < 2)
    fail_at(map.pairs.empty() ? FileLocation{} : map.pairs.front().where,
            "the map pairs {} joints; a pose needs at least two", nodes.size());
  return nodes;
}

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

  /// The height of the target's root above its feet minus the scaled height of the source's root. The roots need not be
  /// the same point of the body.
  double lift(double scale) const { return hip_height(false) - scale * hip_height(true); }

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
      if (ours.norm() < kNoLength || theirs.norm() < kNoLength) continue;
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
    return position_in(nodes_[0], source).y() - position_in(nodes_[lowest()], source).y();
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
      goal.position = scale * source.translation() + rest.source_turn(node, frame) * Vector3d(0, rest.lift(scale), 0);
    } else {
      const Node& parent = nodes[node.parent];
      const PoseGoal& above = goals[node.parent];
      const Vector3d ours = above.rotation * node.offset_from_parent;
      const Vector3d theirs = rest.source_turn(parent, frame) * rest.source_bone(node);
      const Vector3d now = source.translation() - frame[parent.source].translation();
      // A source bone without length has no direction: the joint follows its parent.
      const bool rides = now.norm() < kNoLength || theirs.norm() < kNoLength;
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

JointTracks with_y_up(const JointTracks& source, bool z_up) {
  if (!z_up) return source;
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

}  // namespace

RetargetResult retarget(const Skeleton& skeleton, const JointTracks& given, const JointMap& map,
                        const RetargetOptions& options) {
  const JointTracks source = with_y_up(resample(given, options.frames_per_second), map.z_up);
  std::vector<double> rest =
      options.rest_dofs.empty() ? std::vector<double>(skeleton.dofs.size(), 0.0) : options.rest_dofs;
  std::vector<Node> nodes = resolve(skeleton, source, map);
  const std::vector<Affine3d> rest_pose = skeleton.pose(rest);
  RetargetResult result;
  const RestPoses rests(rest_pose, source.rest, nodes);
  result.scale = rests.scale(map);
  for (const Node& node : nodes)
    result.tracks.push_back(
        {skeleton.joints[node.target].name, source.names[node.source], node.target, node.end, 0.0, 0.0});

  PoseSolver solver(skeleton, options.iterations);
  std::vector<double> dofs = rest;
  for (int f = 0; f < source.num_frames(); ++f) {
    const auto goals = goals_of(nodes, source.frames[f], rests, result.scale, options);
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
