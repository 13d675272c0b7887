#include "doppel/io/figure_export/vrm.h"

#include <algorithm>
#include <map>

#include "doppel/core/error.h"

namespace doppel {
namespace {

const std::vector<std::string> kRequired{"hips",          "spine",         "head",          "leftUpperLeg",
                                         "leftLowerLeg",  "leftFoot",      "rightUpperLeg", "rightLowerLeg",
                                         "rightFoot",     "leftUpperArm",  "leftLowerArm",  "leftHand",
                                         "rightUpperArm", "rightLowerArm", "rightHand"};
const std::vector<std::string> kOptional{"chest",         "upperChest", "neck",     "leftShoulder",
                                         "rightShoulder", "leftToes",   "rightToes"};

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

}  // namespace

tinygltf::Value vrm_extension(const Figure& figure, const std::string& name, const FigureRights& rights,
                              int first_node) {
  if (rights.authors.empty()) fail<UsageError>("VRM metadata of '{}' needs an author: --author NAME", name);
  const std::map<std::string, int> bones = human_bones(figure, first_node);
  if (const auto missing = missing_bones(bones); !missing.empty())
    fail<UsageError>(
        "'{}' lacks bones that VRM 1.0 requires: {}; without --author, the file is written without VRM metadata", name,
        fmt::join(missing, ", "));
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
