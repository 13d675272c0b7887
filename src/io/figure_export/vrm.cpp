#include "doppel/io/figure_export/vrm.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "doppel/core/error.h"

namespace doppel {
namespace {

const std::vector<std::string> kRequired{"hips",          "spine",         "head",          "leftUpperLeg",
                                         "leftLowerLeg",  "leftFoot",      "rightUpperLeg", "rightLowerLeg",
                                         "rightFoot",     "leftUpperArm",  "leftLowerArm",  "leftHand",
                                         "rightUpperArm", "rightLowerArm", "rightHand"};
const std::vector<std::string> kOptional{"chest",         "upperChest", "neck",     "leftShoulder",
                                         "rightShoulder", "leftToes",   "rightToes"};

bool is_finger(const std::string& name) {
  static const std::set<std::string> kFingers = [] {
    std::set<std::string> names;
    for (const auto& [mixamo, vrm] : vrm_fingers()) names.insert(vrm);
    return names;
  }();
  return kFingers.count(name) > 0;
}

std::vector<std::string> missing_bones(const std::map<std::string, int>& bones) {
  std::vector<std::string> missing;
  for (const std::string& name : kRequired)
    if (bones.count(name) == 0) missing.push_back(name);
  return missing;
}

/// The nodes of the bones that VRM knows. VRM allows an upper chest only above a chest.
std::map<std::string, int> human_bones(const Figure& figure, int first_node) {
  std::map<std::string, int> bones;
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) {
    const std::string& name = figure.nodes[i].name;
    for (const auto* known : {&kRequired, &kOptional})
      if (std::find(known->begin(), known->end(), name) != known->end())
        bones.emplace(name, first_node + static_cast<int>(i));
    if (is_finger(name)) bones.emplace(name, first_node + static_cast<int>(i));
  }
  if (bones.count("chest") == 0) bones.erase("upperChest");
  return bones;
}

tinygltf::Value meta(const std::string& name, const FigureRights& rights) {
  tinygltf::Value::Array authors;
  for (const std::string& author : rights.authors) authors.emplace_back(author);
  tinygltf::Value::Object entries{
      {"name", tinygltf::Value(name)},
      {"authors", tinygltf::Value(std::move(authors))},
      {"licenseUrl", tinygltf::Value(std::string("https://vrm.dev/licenses/1.0/"))},
      {"avatarPermission", tinygltf::Value(std::string("onlyAuthor"))},
      {"commercialUsage", tinygltf::Value(std::string("personalNonProfit"))},
      {"creditNotation", tinygltf::Value(std::string("required"))},
      {"modification", tinygltf::Value(std::string("prohibited"))},
      {"allowRedistribution", tinygltf::Value(false)},
  };
  if (!rights.licence.empty()) entries["otherLicenseUrl"] = tinygltf::Value(rights.licence);
  return tinygltf::Value(std::move(entries));
}

/// A node whose bone to another node has one direction in the T-pose.
struct Limb {
  const char *from, *to;
  Eigen::Vector3d direction;
};

const std::vector<Limb> kLimbs{{"leftUpperArm", "leftLowerArm", Eigen::Vector3d::UnitX()},
                               {"leftLowerArm", "leftHand", Eigen::Vector3d::UnitX()},
                               {"rightUpperArm", "rightLowerArm", -Eigen::Vector3d::UnitX()},
                               {"rightLowerArm", "rightHand", -Eigen::Vector3d::UnitX()},
                               {"leftUpperLeg", "leftLowerLeg", -Eigen::Vector3d::UnitY()},
                               {"leftLowerLeg", "leftFoot", -Eigen::Vector3d::UnitY()},
                               {"rightUpperLeg", "rightLowerLeg", -Eigen::Vector3d::UnitY()},
                               {"rightLowerLeg", "rightFoot", -Eigen::Vector3d::UnitY()}};

/// The turn about the vertical after which a figure looks along z: its left is along x.
Eigen::Matrix3d turn_to_z(const Figure& figure, const std::map<std::string, int>& bones) {
  Eigen::Vector3d left = Eigen::Vector3d::Zero();
  for (const char* bone : {"UpperLeg", "UpperArm"})
    left += figure.rest[bones.at(std::string("left") + bone)].translation() -
            figure.rest[bones.at(std::string("right") + bone)].translation();
  return Eigen::AngleAxisd(std::atan2(left.z(), left.x()), Eigen::Vector3d::UnitY()).toRotationMatrix();
}

double lowest_foot(const std::vector<Eigen::Affine3d>& nodes, const std::map<std::string, int>& bones) {
  return std::min(nodes[bones.at("leftFoot")].translation().y(), nodes[bones.at("rightFoot")].translation().y());
}

}  // namespace

void check_avatar(const Figure& figure, const std::string& name, const FigureRights& rights) {
  if (rights.authors.empty()) return;
  if (const auto missing = missing_bones(human_bones(figure, 0)); !missing.empty())
    fail<UsageError>(
        "'{}' lacks bones that VRM 1.0 requires: {}; without --author, the file is written without VRM metadata", name,
        fmt::join(missing, ", "));
}

std::vector<Eigen::Affine3d> t_pose(const Figure& figure) {
  const std::map<std::string, int> bones = human_bones(figure, 0);
  const Eigen::Matrix3d heading = turn_to_z(figure, bones);
  std::map<int, const Limb*> limbs;
  for (const Limb& limb : kLimbs) limbs[bones.at(limb.from)] = &limb;
  std::vector<Eigen::Matrix3d> turns;
  std::vector<Eigen::Affine3d> posed;
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) {
    const int node = static_cast<int>(i), parent = figure.nodes[i].parent;
    const Eigen::Vector3d at = figure.rest[i].translation();
    Eigen::Matrix3d turn = parent < 0 ? heading : turns[parent];
    if (const auto found = limbs.find(node); found != limbs.end()) {
      const Eigen::Vector3d bone = figure.rest[bones.at(found->second->to)].translation() - at;
      turn = Eigen::Quaterniond::FromTwoVectors(turn * bone, found->second->direction).toRotationMatrix() * turn;
    } else if (node == bones.at("leftFoot") || node == bones.at("rightFoot")) {
      turn = heading;  // the sole stays as flat as it is
    }
    Eigen::Affine3d& world = posed.emplace_back(Eigen::Affine3d::Identity());
    world.linear() = turn * figure.rest[i].linear();
    world.translation() = heading * at;
    if (parent >= 0)
      world.translation() = posed[parent].translation() + turns[parent] * (at - figure.rest[parent].translation());
    turns.push_back(turn);
  }
  const double sunk = lowest_foot(posed, bones) - lowest_foot(figure.rest, bones);
  for (Eigen::Affine3d& world : posed) world.translation().y() -= sunk;
  return posed;
}

tinygltf::Value vrm_extension(const Figure& figure, const std::string& name, const FigureRights& rights,
                              int first_node) {
  if (rights.authors.empty()) fail<UsageError>("VRM metadata of '{}' needs an author: --author NAME", name);
  check_avatar(figure, name, rights);
  const std::map<std::string, int> bones = human_bones(figure, first_node);
  tinygltf::Value::Object human;
  for (const auto& [bone, node] : bones)
    human[bone] = tinygltf::Value(tinygltf::Value::Object{{"node", tinygltf::Value(node)}});
  return tinygltf::Value(tinygltf::Value::Object{
      {"specVersion", tinygltf::Value(std::string("1.0"))},
      {"meta", meta(name, rights)},
      {"humanoid", tinygltf::Value(tinygltf::Value::Object{{"humanBones", tinygltf::Value(std::move(human))}})},
  });
}

}  // namespace doppel
