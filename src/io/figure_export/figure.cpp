#include "doppel/io/figure_export/figure.h"

#include <algorithm>
#include <map>
#include <set>

#include "doppel/character/joint_map.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

const std::vector<std::string> kMixamo{"Hips",         "Neck",          "Head",        "LeftArm",      "RightArm",
                                       "LeftShoulder", "RightShoulder", "LeftForeArm", "RightForeArm", "LeftHand",
                                       "RightHand",    "LeftUpLeg",     "RightUpLeg",  "LeftLeg",      "RightLeg",
                                       "LeftFoot",     "RightFoot",     "LeftToeBase", "RightToeBase"};
const std::vector<std::string> kMixamoSpine{"Spine", "Spine1", "Spine2", "Spine3"};
const std::vector<std::string> kVrm{"hips",         "neck",          "head",          "leftUpperArm",  "rightUpperArm",
                                    "leftShoulder", "rightShoulder", "leftLowerArm",  "rightLowerArm", "leftHand",
                                    "rightHand",    "leftUpperLeg",  "rightUpperLeg", "leftLowerLeg",  "rightLowerLeg",
                                    "leftFoot",     "rightFoot",     "leftToes",      "rightToes"};
const std::vector<std::string> kVrmSpine{"spine", "chest", "upperChest"};

/// The joints that carry bones, parents first.
void add_nodes(const Character& character, Figure& figure) {
  const std::set<int> carriers(character.bone_joint.begin(), character.bone_joint.end());
  std::map<int, int> node_of;
  std::map<std::string, int> uses;
  for (const int joint : carriers) {
    FigureNode node;
    const Joint& source = character.skeleton.joints[joint];
    const int use = uses[bone_name(source.name)]++;
    node.name = bone_name(source.name) + (use > 0 ? std::to_string(use + 1) : "");
    node.joint = joint;
    for (int above = source.parent; above >= 0 && node.parent < 0; above = character.skeleton.joints[above].parent)
      if (const auto found = node_of.find(above); found != node_of.end()) node.parent = found->second;
    node_of[joint] = static_cast<int>(figure.nodes.size());
    figure.nodes.push_back(node);
  }
}

/// The nodes between the neck and the hips, from below.
std::vector<int> spine_of(const Figure& figure, const std::string& hips, const std::string& neck) {
  std::vector<int> spine;
  const auto named = [&](const std::string& name) {
    for (std::size_t i = 0; i < figure.nodes.size(); ++i)
      if (figure.nodes[i].name == name) return static_cast<int>(i);
    return -1;
  };
  const int low = named(hips), top = named(neck);
  if (low < 0 || top < 0) return {};
  int i = figure.nodes[top].parent;
  for (; i >= 0 && i != low; i = figure.nodes[i].parent) spine.push_back(i);
  if (i < 0) return {};
  std::reverse(spine.begin(), spine.end());
  return spine;
}

/// The lowest node above both of two nodes; -1 without one.
int common_node(const Figure& figure, int a, int b) {
  while (a != b && a >= 0 && b >= 0) (a > b ? a : b) = figure.nodes[std::max(a, b)].parent;
  return a == b ? a : -1;
}

/// The root of the body where no name says so: the node above both thighs and the neck.
std::string hips_by_tree(const Figure& figure, const std::map<std::string, std::string>& renamed,
                         const std::vector<std::string>& parts) {
  int common = -1;
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) {
    const auto found = renamed.find(figure.nodes[i].name);
    if (found == renamed.end() || std::find(parts.begin(), parts.end(), found->second) == parts.end()) continue;
    common = common < 0 ? static_cast<int>(i) : common_node(figure, common, static_cast<int>(i));
    if (common < 0) return "";
  }
  return common < 0 || renamed.count(figure.nodes[common].name) > 0 ? "" : figure.nodes[common].name;
}

/// `LeftHandIndex1` for `mixamorig:LeftHandIndex1`.
std::string without_prefix(const std::string& name) {
  const std::size_t colon = name.rfind(':');
  return colon == std::string::npos ? name : name.substr(colon + 1);
}

void rename_nodes(Figure& figure, BoneNames names) {
  const bool vrm = names == BoneNames::vrm;
  const std::string prefix = vrm ? "" : "mixamorig:";
  const std::vector<std::string>&words = vrm ? kVrm : kMixamo, &spine_words = vrm ? kVrmSpine : kMixamoSpine;
  std::vector<std::string> own;
  for (const FigureNode& node : figure.nodes) own.push_back(node.name);
  const JointMap map = guess_joint_map(own, words);
  std::map<std::string, std::string> renamed;
  for (const JointMap::Pair& pair : map.pairs) renamed[pair.target] = pair.source;
  std::string hips, neck;
  for (const auto& [bone, word] : renamed) {
    if (word == words[0]) hips = bone;
    if (word == words[1]) neck = bone;
  }
  if (hips.empty()) {
    hips = hips_by_tree(figure, renamed,
                        vrm ? std::vector<std::string>{"neck", "leftUpperLeg", "rightUpperLeg"}
                            : std::vector<std::string>{"Neck", "LeftUpLeg", "RightUpLeg"});
    if (!hips.empty()) renamed[hips] = words[0];
  }
  const std::vector<int> spine = spine_of(figure, hips, neck);
  for (std::size_t i = 0; i < std::min(spine.size(), spine_words.size()); ++i)
    renamed.emplace(figure.nodes[spine[i]].name, spine_words[i]);
  std::set<std::string> fingers;  // of two with one name after the prefix, the first
  for (const FigureNode& node : figure.nodes)
    if (const auto finger = vrm_fingers().find(without_prefix(node.name));
        finger != vrm_fingers().end() && fingers.insert(finger->first).second)
      renamed.emplace(node.name, vrm ? finger->second : finger->first);
  for (FigureNode& node : figure.nodes)
    if (const auto found = renamed.find(node.name); found != renamed.end()) node.name = prefix + found->second;
}

std::map<int, int> nodes_of_joints(const Figure& figure) {
  std::map<int, int> node_of_joint;
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) node_of_joint[figure.nodes[i].joint] = static_cast<int>(i);
  return node_of_joint;
}

/// Adds the weights of a vertex, times a factor, to sums by node.
void add_weights_of(const Character& character, const std::map<int, int>& node_of_joint, int vertex, double factor,
                    std::map<int, double>& sums) {
  const auto& rows = character.skin.vertex_bones;
  for (int i = rows.offsets[vertex]; i < rows.offsets[as_size(vertex) + 1]; ++i)
    sums[node_of_joint.at(character.bone_joint[rows.items[i]])] += factor * character.skin.weights[i];
}

/// Appends a vertex with the four largest of its weights.
void append_weights(const std::map<int, double>& sums, Figure& figure) {
  std::vector<std::pair<double, int>> sorted;
  for (const auto& [node, weight] : sums)
    if (weight > 0.0) sorted.emplace_back(weight, node);
  std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  double kept = 0.0, dropped = 0.0;
  for (std::size_t i = 0; i < sorted.size(); ++i) (i < 4 ? kept : dropped) += sorted[i].first;
  figure.largest_dropped_weight = std::max(figure.largest_dropped_weight, dropped);
  sorted.resize(std::min<std::size_t>(sorted.size(), 4));
  std::array<int, 4>& node = figure.node.emplace_back();
  std::array<float, 4>& share = figure.weight.emplace_back();
  // The largest weight takes the rounding, so that the sum is 1 in single precision.
  float rest = 1.0F;
  for (std::size_t i = sorted.size(); i-- > 0;) {
    const float weight = i == 0 ? rest : static_cast<float>(sorted[i].first / kept);
    if (!(weight > 0.0F)) continue;
    node[i] = sorted[i].second;
    share[i] = weight;
    rest -= weight;
  }
}

void add_weights(const Character& character, Figure& figure) {
  const std::map<int, int> node_of_joint = nodes_of_joints(figure);
  for (int v = 0; v < character.num_vertices(); ++v) {
    std::map<int, double> sums;
    add_weights_of(character, node_of_joint, v, 1.0, sums);
    append_weights(sums, figure);
  }
}

}  // namespace

Figure make_figure(const Character& character, BoneNames names) {
  Figure figure;
  add_nodes(character, figure);
  if (names != BoneNames::skeletool) rename_nodes(figure, names);
  add_weights(character, figure);
  figure.rest = pose_nodes(figure, character.skeleton, character.rest_dofs);
  figure.rest_vertices = character.mesh.vertices;
  return figure;
}

const std::map<std::string, std::string>& vrm_fingers() {
  static const std::map<std::string, std::string> kNames = [] {
    constexpr std::array<std::array<const char*, 2>, 5> kFingers{
        {{"Thumb", "Thumb"}, {"Index", "Index"}, {"Middle", "Middle"}, {"Ring", "Ring"}, {"Pinky", "Little"}}};
    std::map<std::string, std::string> names;
    for (const auto& [mixamo, vrm] : kFingers) {
      const bool thumb = std::string(vrm) == "Thumb";
      const std::array<const char*, 3> parts{thumb ? "Metacarpal" : "Proximal", thumb ? "Proximal" : "Intermediate",
                                             "Distal"};
      for (std::size_t k = 0; k < parts.size(); ++k) {
        names["LeftHand" + std::string(mixamo) + std::to_string(k + 1)] = "left" + std::string(vrm) + parts[k];
        names["RightHand" + std::string(mixamo) + std::to_string(k + 1)] = "right" + std::string(vrm) + parts[k];
      }
    }
    return names;
  }();
  return kNames;
}

std::map<std::string, std::string> renamed_bones(const Character& character, BoneNames names) {
  std::map<std::string, std::string> renamed;
  if (names == BoneNames::skeletool) return renamed;
  Figure own;
  add_nodes(character, own);
  Figure figure = own;
  rename_nodes(figure, names);
  for (std::size_t i = 0; i < own.nodes.size(); ++i)
    if (figure.nodes[i].name != own.nodes[i].name) renamed[own.nodes[i].name] = figure.nodes[i].name;
  return renamed;
}

Figure figure_of_points(Figure figure, const Character& character, const std::vector<FigurePoint>& points) {
  figure.node.clear();
  figure.weight.clear();
  figure.rest_vertices.clear();
  figure.largest_dropped_weight = 0.0;
  const std::map<int, int> node_of_joint = nodes_of_joints(figure);
  for (const FigurePoint& point : points) {
    std::map<int, double> sums;
    for (std::size_t k = 0; k < 3; ++k)
      add_weights_of(character, node_of_joint, point.corners[k], point.barycentrics[k], sums);
    append_weights(sums, figure);
    figure.rest_vertices.push_back(point.rest);
  }
  return figure;
}

std::vector<Eigen::Affine3d> pose_nodes(const Figure& figure, const Skeleton& skeleton,
                                        const std::vector<double>& dofs) {
  const std::vector<Eigen::Affine3d> joints = skeleton.pose(dofs);
  std::vector<Eigen::Affine3d> posed;
  for (const FigureNode& node : figure.nodes) posed.push_back(joints[node.joint]);
  return posed;
}

std::vector<Eigen::Affine3d> blend_transforms(const Figure& figure, const std::vector<Eigen::Affine3d>& posed) {
  std::vector<Eigen::Matrix4d> moved;
  for (std::size_t i = 0; i < posed.size(); ++i) moved.push_back((posed[i] * figure.rest[i].inverse()).matrix());
  std::vector<Eigen::Affine3d> blended(figure.node.size());
  for (std::size_t v = 0; v < blended.size(); ++v) {
    Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
    for (std::size_t i = 0; i < 4; ++i) sum += static_cast<double>(figure.weight[v][i]) * moved[figure.node[v][i]];
    blended[v] = Eigen::Affine3d(sum);
  }
  return blended;
}

}  // namespace doppel
