#include "doppel/character/mapped_joints.h"

#include <algorithm>

#include "doppel/core/config.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

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
int node_above(const Skeleton& skeleton, const std::vector<MappedJoint>& nodes, int target) {
  for (int j = skeleton.joints[target].parent; j >= 0; j = skeleton.joints[j].parent)
    for (std::size_t n = 0; n < nodes.size(); ++n)
      if (nodes[n].target == j) return static_cast<int>(n);
  return -1;
}

}  // namespace

std::vector<MappedJoint> mapped_joints(const Skeleton& skeleton, const JointTracks& source, const JointMap& map) {
  std::vector<std::string> targets;
  for (const Joint& joint : skeleton.joints) targets.push_back(joint.name);
  std::vector<MappedJoint> nodes;
  for (const JointMap::Pair& pair : map.pairs) {
    MappedJoint node;
    node.target = find_joint(targets, pair.target, pair.where, "character");
    node.source = find_joint(source.names, pair.source, pair.where, "motion's skeleton");
    node.rest_turn = (Eigen::AngleAxisd(pair.rest_rotation.z(), Vector3d::UnitZ()) *
                      Eigen::AngleAxisd(pair.rest_rotation.y(), Vector3d::UnitY()) *
                      Eigen::AngleAxisd(pair.rest_rotation.x(), Vector3d::UnitX()))
                         .toRotationMatrix();
    for (const MappedJoint& other : nodes)
      if (other.target == node.target)
        fail_at(pair.where, "the character's joint '{}' is mapped twice", skeleton.joints[node.target].name);
    nodes.push_back(node);
  }
  std::sort(nodes.begin(), nodes.end(), [](const MappedJoint& a, const MappedJoint& b) { return a.target < b.target; });
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

}  // namespace doppel
