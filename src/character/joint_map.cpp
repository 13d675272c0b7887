#include "doppel/character/joint_map.h"

#include <algorithm>
#include <cctype>
#include <set>

#include "doppel/core/angles.h"
#include "doppel/core/config.h"

namespace doppel {
namespace {

Eigen::Vector3d read_rotation(const ConfigReader& rotations, const std::string& target) {
  const std::vector<double> degrees = rotations.list<double>(target);
  if (degrees.size() != 3)
    rotations.fail_at_key(target, "found {} numbers, expected three angles in degrees, about x, y and z",
                          degrees.size());
  for (const double angle : degrees)
    if (!(std::abs(angle) <= 360.0)) rotations.fail_at_key(target, "found {}, allowed is -360 to 360 degrees", angle);
  return Eigen::Vector3d(degrees[0], degrees[1], degrees[2]) * kRadiansPerDegree;
}

/// `scale: hip_height`, `leg_length`, or a number.
void read_scale(const ConfigReader& root, JointMap& map) {
  const std::string word = root.get("scale", "leg_length");
  if (word == "hip_height" || word == "leg_length") {
    map.scale = word == "hip_height" ? JointMap::Scale::hip_height : JointMap::Scale::leg_length;
    return;
  }
  if (word.empty() || std::isalpha(static_cast<unsigned char>(word[0])) != 0)
    root.fail_at_key("scale", "found \"{}\", allowed is hip_height, leg_length or a number", word);
  map.scale = JointMap::Scale::number;
  map.factor = root.get<double>("scale", between(0.01, 100.0));
}

/// A name without namespace, case and punctuation: `mixamorig:LeftArm` -> `leftarm`.
std::string plain(const std::string& name) {
  const std::size_t colon = name.find_last_of(':');
  std::string result;
  for (const char c : colon == std::string::npos ? name : name.substr(colon + 1))
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      result += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const std::string prefix : {"mixamorig", "bip01", "bip001"})
    if (result.size() > prefix.size() && result.compare(0, prefix.size(), prefix) == 0) result.erase(0, prefix.size());
  return result;
}

/// A part of the body and its possible names, best first; `*` stands for the side.
struct Role {
  std::vector<std::string> names;
  bool sided;
};

// The order matters: a name is used once, so that `LeftShoulder` is the upper arm only where there is no `LeftArm`, and
// `L_Foot` is a toe where there is an `L_Ankle`.
const std::vector<Role>& roles() {
  static const std::vector<Role> all{
      {{"hips", "hip", "pelvis", "root"}, false},
      {{"neck", "neck1", "lowerneck", "necklower"}, false},
      {{"head"}, false},
      {{"headtopend", "headee", "headend", "headnub"}, false},
      {{"*arm", "*upperarm", "*shldr", "*shldrbend", "*shoulder"}, true},
      {{"*collar", "*clavicle", "*shoulder"}, true},
      {{"*forearm", "*lowerarm", "*forearmbend", "*elbow"}, true},
      {{"*wrist", "*hand", "*forearmee", "*forearmend", "*elbowend"}, true},
      {{"*upleg", "*upperleg", "*thigh", "*thighbend", "*hip"}, true},
      {{"*leg", "*lowerleg", "*shin", "*calf", "*knee"}, true},
      {{"*ankle", "*foot"}, true},
      {{"*toebase", "*toe", "*toes", "*toe0", "*foot", "*footee", "*footend", "*ankleend", "*toebaseend"}, true},
  };
  return all;
}

/// The spellings of a name for one side: left, l, and with the side at the end (`arm.L`).
std::vector<std::string> spellings(const std::string& pattern, const std::string& side) {
  if (pattern[0] != '*') return {pattern};
  const std::string part = pattern.substr(1), letter = side.substr(0, 1);
  return {side + part, letter + part, part + letter, part + side};
}

/// The bone names of joints, without repetitions.
std::vector<std::string> bones_of(const std::vector<std::string>& joints) {
  std::vector<std::string> names;
  for (const std::string& joint : joints) {
    const std::string bone = joint.substr(0, joint.find('_'));
    if (!bone.empty() && std::find(names.begin(), names.end(), bone) == names.end()) names.push_back(bone);
  }
  return names;
}

/// The unused name for `role` on `side`; empty when there is none.
std::string find_role(const Role& role, const std::string& side, const std::vector<std::string>& names,
                      std::set<std::string>& used) {
  for (const std::string& pattern : role.names)
    for (const std::string& spelling : spellings(pattern, side))
      for (const std::string& name : names)
        if (plain(name) == spelling && used.insert(name).second) return name;
  return "";
}

}  // namespace

JointMap read_joint_map(const std::filesystem::path& path) {
  const ConfigDocument document = ConfigDocument::load(path);
  const ConfigReader root = document.root();
  JointMap map;
  const ConfigReader joints = root.section("joints"), rotations = root.section("rest_rotation");
  std::set<std::string> seen;
  for (const std::string& target : joints.keys()) {
    if (!seen.insert(target).second) joints.fail_at_key(target, "this joint occurs twice");
    map.pairs.push_back({target, joints.get<std::string>(target), Eigen::Vector3d::Zero(), joints.where(target)});
  }
  if (map.pairs.empty())
    root.fail_at_key("", "the map needs `joints:` with lines `<joint of the character>: <joint of the motion>`");
  const std::vector<std::string> targets(seen.begin(), seen.end());
  for (const std::string& target : rotations.keys()) {
    const auto pair =
        std::find_if(map.pairs.begin(), map.pairs.end(), [&](const auto& p) { return p.target == target; });
    if (pair == map.pairs.end())
      rotations.fail_at_key(target, "this joint is not among `joints`{}", nearest_word_hint(target, targets));
    pair->rest_rotation = read_rotation(rotations, target);
  }
  read_scale(root, map);
  if (root.has("up")) map.z_up = root.choice("up", {"y", "z"}, "y") == "z";
  root.finish();
  return map;
}

JointMap guess_joint_map(const std::vector<std::string>& target, const std::vector<std::string>& source) {
  const std::vector<std::string> bones = bones_of(target);
  std::vector<std::string> joints = source;  // plus the bones of a skeleton whose joints are single axes
  for (const std::string& bone : bones_of(source))
    if (std::find(joints.begin(), joints.end(), bone) == joints.end()) joints.push_back(bone);
  std::set<std::string> used_bones, used_sources;
  JointMap map;
  for (const Role& role : roles())
    for (const std::string side : {"left", "right"}) {
      if (!role.sided && side == "right") continue;
      std::set<std::string> bones_then = used_bones, sources_then = used_sources;
      const std::string bone = find_role(role, side, bones, bones_then);
      const std::string joint = find_role(role, side, joints, sources_then);
      // A part that only one skeleton has leaves its names to other parts.
      if (bone.empty() || joint.empty()) continue;
      used_bones = bones_then;
      used_sources = sources_then;
      map.pairs.push_back({bone, joint, Eigen::Vector3d::Zero(), {"the guessed joint map", 0}});
    }
  if (map.pairs.size() < 5)
    fail<UsageError>(
        "only {} joints could be paired by their names; write a joint map (--map). Joints of the character: {}. Joints "
        "of "
        "the motion: {}",
        map.pairs.size(), fmt::join(bones, " "), fmt::join(source, " "));
  return map;
}

std::string joint_map_text(const JointMap& map) {
  YAML::Emitter out;
  out << YAML::BeginMap << YAML::Key << "joints" << YAML::Value << YAML::BeginMap;
  bool turned = false;
  for (const JointMap::Pair& pair : map.pairs) {
    out << YAML::Key << pair.target << YAML::Value << pair.source;
    turned |= !pair.rest_rotation.isZero();
  }
  out << YAML::EndMap << YAML::Key << "scale" << YAML::Value;
  if (map.scale == JointMap::Scale::number)
    out << map.factor;
  else
    out << (map.scale == JointMap::Scale::hip_height ? "hip_height" : "leg_length");
  if (map.z_up) out << YAML::Key << "up" << YAML::Value << (*map.z_up ? "z" : "y");
  if (turned) {
    out << YAML::Key << "rest_rotation" << YAML::Value << YAML::BeginMap;
    for (const JointMap::Pair& pair : map.pairs) {
      if (pair.rest_rotation.isZero()) continue;
      const Eigen::Vector3d degrees = pair.rest_rotation / kRadiansPerDegree;
      out << YAML::Key << pair.target << YAML::Value << YAML::Flow << YAML::BeginSeq << degrees.x() << degrees.y()
          << degrees.z() << YAML::EndSeq;
    }
    out << YAML::EndMap;
  }
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace doppel
