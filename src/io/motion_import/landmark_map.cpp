#include "doppel/io/motion_import/landmark_map.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "doppel/core/error.h"
#include "doppel/io/rig_import/landmarks_of_rig.h"

namespace doppel {

namespace {

constexpr std::size_t kMinPairs = 5;
using Landmarks = std::array<int, kBodyLandmarks.size()>;

int landmark(const std::string& name) {
  return static_cast<int>(std::find(kBodyLandmarks.begin(), kBodyLandmarks.end(), name) - kBodyLandmarks.begin());
}

/// The bones of a skeleton as joints of a rig: one for each run of joints that share a name up to the first `_`.
std::vector<RigJoint> bones_of_skeleton(const Skeleton& skeleton, const std::vector<double>& rest_dofs) {
  const auto rest = skeleton.pose(rest_dofs);
  std::vector<RigJoint> bones;
  std::map<std::string, int> index_of;
  std::vector<int> bone_of;  // of each joint
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const Joint& joint = skeleton.joints[j];
    const std::string name = bone_name(joint.name);
    const auto [found, is_new] = index_of.emplace(name, static_cast<int>(bones.size()));
    bone_of.push_back(found->second);
    const Eigen::Vector3d position = rest[j].translation();
    if (is_new)
      bones.push_back({name, joint.parent < 0 ? -1 : bone_of[joint.parent], position});
    else
      bones[found->second].position = position;  // as the joint map: the last joint of the bone
  }
  return bones;
}

std::vector<RigJoint> joints_of_tracks(const JointTracks& tracks) {
  std::vector<RigJoint> joints;
  for (std::size_t j = 0; j < tracks.names.size(); ++j)
    joints.push_back({tracks.names[j], tracks.parents[j], tracks.rest[j].translation()});
  return joints;
}

/// The only joint below another, or -1.
int only_child(const std::vector<RigJoint>& joints, int joint) {
  int child = -1;
  for (std::size_t j = 0; joint >= 0 && j < joints.size(); ++j) {
    if (joints[j].parent != joint) continue;
    if (child >= 0) return -1;
    child = static_cast<int>(j);
  }
  return child;
}

Landmarks landmarks_with_ends(const std::vector<RigJoint>& joints) {
  Landmarks found = find_landmarks(joints);
  for (const std::string side : {"left_", "right_"})
    for (const auto& [end, above] : {std::pair{"wrist", "elbow"}, {"toe", "ankle"}})
      if (int& joint = found[landmark(side + end)]; joint < 0)
        joint = only_child(joints, found[landmark(side + above)]);
  return found;
}

bool is_below(const std::vector<RigJoint>& joints, int joint, int ancestor) {
  for (joint = joints[joint].parent; joint >= 0; joint = joints[joint].parent)
    if (joint == ancestor) return true;
  return false;
}

/// The pelvis, or the nearest joint above it that also carries the hips: in some rigs the legs hang beside the pelvis.
int root_of_body(const std::vector<RigJoint>& joints, const Landmarks& landmarks) {
  int root = landmarks[landmark("pelvis")];
  for (const char* name : {"left_hip", "right_hip"})
    if (const int hip = landmarks[landmark(name)]; hip >= 0)
      while (root >= 0 && !is_below(joints, hip, root)) root = joints[root].parent;
  return root;
}

/// A name without `_` and blanks, which a character's bones do not have (rig_import).
std::string as_bone(std::string name) {
  for (char& c : name)
    if (c == '_' || c == ' ') c = '-';
  return name;
}

std::vector<std::string> names_of(const std::vector<RigJoint>& joints) {
  std::vector<std::string> names;
  for (const RigJoint& joint : joints) names.push_back(joint.name);
  return names;
}

}  // namespace

JointMap landmark_joint_map(const Skeleton& skeleton, const std::vector<double>& rest_dofs, const JointTracks& source) {
  const std::vector<RigJoint> ours = bones_of_skeleton(skeleton, rest_dofs), theirs = joints_of_tracks(source);
  const Landmarks here = landmarks_with_ends(ours), there = landmarks_with_ends(theirs);
  JointMap map;
  std::set<int> taken_here, taken_there;
  const auto pair = [&](int a, int b) {
    if (a < 0 || b < 0 || taken_here.count(a) != 0 || taken_there.count(b) != 0) return;
    taken_here.insert(a);
    taken_there.insert(b);
    map.pairs.push_back({ours[a].name, theirs[b].name, Eigen::Vector3d::Zero(), {"the guessed joint map", 0}});
  };
  const int root = root_of_body(ours, here), other_root = root_of_body(theirs, there);
  pair(root, other_root);
  // Limbs first: of a trunk in one piece, pelvis, spine and chest may be one joint. A joint of the character that is
  // not below the root (the target of a foot for inverse kinematics) would be a second root of the map.
  for (std::size_t i = kBodyLandmarks.size(); i-- > 0;)
    if (here[i] >= 0 && is_below(ours, here[i], root)) pair(here[i], there[i]);
  const bool leg = taken_here.count(here[landmark("left_knee")]) != 0;
  if (map.pairs.size() < kMinPairs || !leg || taken_here.count(root) == 0)
    fail<UsageError>(
        "{} joints of the motion are recognised as those of a body; needed are the pelvis, a leg and more. Write a "
        "joint map (--map). Joints of the character: {}. Joints of the motion: {}",
        map.pairs.size(), fmt::join(names_of(ours), " "), fmt::join(source.names, " "));
  for (std::size_t a = 0; a < ours.size(); ++a)
    for (std::size_t b = 0; b < theirs.size(); ++b)
      if (as_bone(theirs[b].name) == ours[a].name && is_below(ours, static_cast<int>(a), root) &&
          is_below(theirs, static_cast<int>(b), other_root))
        pair(static_cast<int>(a), static_cast<int>(b));
  return map;
}

}  // namespace doppel
