#include "doppel/io/figure_export/figure.h"

#include <algorithm>
#include <set>

#include "doppel/character/joint_map.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

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

/// The bone of a part of the body; empty without one.
std::string bone_of_part(const std::map<std::string, std::string>& parts, const std::string& part) {
  for (const auto& [bone, found] : parts)
    if (found == part) return bone;
  return "";
}

/// The part of the body that each bone is, as far as names and tree show it.
std::map<std::string, std::string> parts_of_bones(const Figure& figure) {
  std::vector<std::string> own;
  for (const FigureNode& node : figure.nodes) own.push_back(node.name);
  std::map<std::string, std::string> parts;
  for (const JointMap::Pair& pair : guess_joint_map(own, body_parts()).pairs) parts[pair.target] = pair.source;
  std::string hips = bone_of_part(parts, "Hips"), neck = bone_of_part(parts, "Neck");
  if (hips.empty()) hips = hips_by_tree(figure, parts, {"Neck", "LeftUpLeg", "RightUpLeg"});
  if (!hips.empty()) parts[hips] = "Hips";
  if (neck.empty()) neck = bone_of_part(parts, "Head");
  std::size_t spine = 0;
  for (const int node : spine_of(figure, hips, neck))
    if (spine < spine_parts().size() && parts.emplace(figure.nodes[node].name, spine_parts()[spine]).second) ++spine;
  std::set<std::string> fingers;  // of two with one name after the prefix, the first
  for (const FigureNode& node : figure.nodes)
    if (const auto finger = vrm_fingers().find(without_prefix(node.name));
        finger != vrm_fingers().end() && fingers.insert(finger->first).second)
      parts.emplace(node.name, finger->first);
  if (figure.nodes[0].name != hips) parts.emplace(figure.nodes[0].name, "Root");
  return parts;
}

/// Numbers for the nodes that kept a name which another node got.
void number_repeated(Figure& figure, const std::vector<bool>& renamed) {
  std::set<std::string> taken;
  for (std::size_t i = 0; i < renamed.size(); ++i)
    if (renamed[i]) taken.insert(figure.nodes[i].name);
  for (std::size_t i = 0; i < renamed.size(); ++i) {
    if (renamed[i]) continue;
    std::string& name = figure.nodes[i].name;
    const std::string own = name;
    for (int number = 2; !taken.insert(name).second; ++number) name = own + "_" + std::to_string(number);
  }
}

/// @throws UsageError when bones are missing that the convention requires. @param who the character
void rename_nodes(Figure& figure, BoneNames names, const std::string& who) {
  const NameConvention& convention = name_convention(names);
  const std::map<std::string, std::string> parts = parts_of_bones(figure);
  std::vector<std::string> missing;
  for (const std::string& part : convention.required)
    if (bone_of_part(parts, part).empty()) missing.push_back(convention.names.at(part));
  if (!missing.empty())
    fail<UsageError>(
        "'{}' lacks bones that --names {} needs: {}; programs would not take it for a human. `--names mixamo` and the "
        "character's own names need none of them",
        who, bone_names_words().at(static_cast<std::size_t>(names)), fmt::join(missing, ", "));
  std::vector<bool> renamed;
  for (FigureNode& node : figure.nodes) {
    const auto part = parts.find(node.name);
    const auto name = part == parts.end() ? convention.names.end() : convention.names.find(part->second);
    renamed.push_back(name != convention.names.end());
    if (renamed.back()) node.name = convention.prefix + name->second;
  }
  number_repeated(figure, renamed);
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
  if (names != BoneNames::skeletool) rename_nodes(figure, names, character.name);
  add_weights(character, figure);
  figure.rest = pose_nodes(figure, character.skeleton, character.rest_dofs);
  figure.rest_vertices = character.mesh.vertices;
  return figure;
}

std::map<std::string, std::string> renamed_bones(const Character& character, BoneNames names) {
  std::map<std::string, std::string> renamed;
  if (names == BoneNames::skeletool) return renamed;
  Figure own;
  add_nodes(character, own);
  Figure figure = own;
  rename_nodes(figure, names, character.name);
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
