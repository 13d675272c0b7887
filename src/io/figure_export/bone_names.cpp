#include "doppel/io/figure_export/bone_names.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <functional>

#include "doppel/core/error.h"

namespace doppel {
namespace {

/// The side of a body: `Left`, `left`, `l`.
struct Side {
  std::string word, small, letter;
};
const std::array<Side, 2> kSides{{{"Left", "left", "l"}, {"Right", "right", "r"}}};

/// The name of a part, given its word in the convention and its side.
using SidedName = std::function<std::string(const std::string& part, const Side& side)>;
/// The name of a bone of a finger: `finger` as Mixamo calls it, bones from the hand outwards 0, 1, 2.
using FingerName = std::function<std::string(const std::string& finger, std::size_t bone, const Side& side)>;

/// The words of a convention, for each part without a side, and each part with one.
struct Words {
  std::vector<std::string> middle;  ///< hips, neck, head
  std::vector<std::string> sided;   ///< arm, shoulder, forearm, hand, thigh, shin, foot, toes
  std::vector<std::string> spine;   ///< from below
};
const Words kMixamoWords{{"Hips", "Neck", "Head"},
                         {"Arm", "Shoulder", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase"},
                         {"Spine", "Spine1", "Spine2", "Spine3"}};
const Words kHumanWords{// of VRM and Unity
                        {"Hips", "Neck", "Head"},
                        {"UpperArm", "Shoulder", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toes"},
                        {"Spine", "Chest", "UpperChest"}};
const Words kUnrealWords{{"pelvis", "neck_01", "head"},
                         {"upperarm", "clavicle", "lowerarm", "hand", "thigh", "calf", "foot", "ball"},
                         {"spine_01", "spine_02", "spine_03", "spine_04", "spine_05"}};

std::string small(std::string word) {
  word[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(word[0])));
  return word;
}

std::map<std::string, std::string> names_by_part(const Words& words, const SidedName& sided, const FingerName& finger) {
  std::map<std::string, std::string> names;
  for (std::size_t i = 0; i < words.middle.size(); ++i) names[kMixamoWords.middle[i]] = words.middle[i];
  for (std::size_t i = 0; i < words.spine.size(); ++i) names[spine_parts()[i]] = words.spine[i];
  for (const Side& side : kSides) {
    for (std::size_t i = 0; i < words.sided.size(); ++i)
      names[side.word + kMixamoWords.sided[i]] = sided(words.sided[i], side);
    for (const char* which : {"Thumb", "Index", "Middle", "Ring", "Pinky"})
      for (std::size_t bone = 0; bone < 3; ++bone)
        names[side.word + "Hand" + which + std::to_string(bone + 1)] = finger(which, bone, side);
  }
  return names;
}

/// `IndexProximal`, in VRM and in Unity. @param thumb the bones of the thumb, which the two call differently
std::string human_finger(const std::string& finger, std::size_t bone, const std::array<const char*, 3>& thumb) {
  constexpr std::array<const char*, 3> kBones{"Proximal", "Intermediate", "Distal"};
  if (finger == "Thumb") return finger + thumb[bone];
  return (finger == "Pinky" ? "Little" : finger) + kBones[bone];
}

NameConvention mixamo() {
  return {"mixamorig:",
          names_by_part(
              kMixamoWords, [](const std::string& part, const Side& side) { return side.word + part; },
              [](const std::string& finger, std::size_t bone, const Side& side) {
                return side.word + "Hand" + finger + std::to_string(bone + 1);
              }),
          {}};
}

NameConvention vrm() {
  NameConvention convention{
      "",
      names_by_part(
          kHumanWords, [](const std::string& part, const Side& side) { return side.small + part; },
          [](const std::string& finger, std::size_t bone, const Side& side) {
            return side.small + human_finger(finger, bone, {"Metacarpal", "Proximal", "Distal"});
          }),
      {}};
  for (auto& [part, name] : convention.names) name = small(name);
  return convention;
}

/// The parts that the avatars of VRM and Unity must have, and without which a mannequin has no chains to retarget.
std::vector<std::string> human_parts() {
  std::vector<std::string> parts{"Hips", "Spine", "Head"};
  for (const Side& side : kSides)
    for (const char* part : {"Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot"}) parts.push_back(side.word + part);
  return parts;
}

NameConvention unity() {
  return {"",
          names_by_part(
              kHumanWords, [](const std::string& part, const Side& side) { return side.word + part; },
              [](const std::string& finger, std::size_t bone, const Side& side) {
                return side.word + human_finger(finger, bone, {"Proximal", "Intermediate", "Distal"});
              }),
          human_parts()};
}

NameConvention unreal() {
  NameConvention convention{
      "",
      names_by_part(
          kUnrealWords, [](const std::string& part, const Side& side) { return part + "_" + side.letter; },
          [](const std::string& finger, std::size_t bone, const Side& side) {
            return small(finger) + "_0" + std::to_string(bone + 1) + "_" + side.letter;
          }),
      human_parts()};
  convention.names["Root"] = "root";
  return convention;
}

}  // namespace

const std::vector<std::string>& bone_names_words() {
  static const std::vector<std::string> kWords{"skeletool", "mixamo", "vrm", "unity", "unreal"};
  return kWords;
}

BoneNames bone_names_of(const std::string& word) {
  const std::vector<std::string>& words = bone_names_words();
  const auto found = std::find(words.begin(), words.end(), word);
  if (found == words.end())
    fail<UsageError>("names of bones: found '{}', allowed are {}", word, fmt::join(words, ", "));
  return static_cast<BoneNames>(found - words.begin());
}

const NameConvention& name_convention(BoneNames names) {
  static const std::map<BoneNames, NameConvention> kConventions{{BoneNames::mixamo, mixamo()},
                                                                {BoneNames::vrm, vrm()},
                                                                {BoneNames::unity, unity()},
                                                                {BoneNames::unreal, unreal()}};
  return kConventions.at(names);
}

const std::vector<std::string>& body_parts() {
  static const std::vector<std::string> kParts = [] {
    std::vector<std::string> parts = kMixamoWords.middle;
    for (const std::string& part : kMixamoWords.sided)
      for (const Side& side : kSides) parts.push_back(side.word + part);
    return parts;
  }();
  return kParts;
}

const std::vector<std::string>& spine_parts() {
  static const std::vector<std::string> kParts{"Spine", "Spine1", "Spine2", "Spine3", "Spine4"};
  return kParts;
}

const std::map<std::string, std::string>& vrm_fingers() {
  static const std::map<std::string, std::string> kNames = [] {
    std::map<std::string, std::string> fingers;
    for (const auto& [part, name] : name_convention(BoneNames::vrm).names)
      if (std::isdigit(static_cast<unsigned char>(part.back())) != 0 && part.find("Hand") != std::string::npos)
        fingers[part] = name;
    return fingers;
  }();
  return kNames;
}

}  // namespace doppel
