#pragma once

#include <map>
#include <string>
#include <vector>

namespace doppel {

/// The names that the nodes of an exported figure get: the character's own (skeletool), or those of a convention.
///   mixamo  mixamorig:Hips, mixamorig:Spine, mixamorig:LeftForeArm, mixamorig:LeftHandIndex1
///   vrm     hips, spine, leftLowerArm, leftIndexProximal: VRM 1.0
///   unity   Hips, Spine, LeftLowerArm, LeftIndexProximal: HumanBodyBones of Unity
///   unreal  pelvis, spine_01, lowerarm_l, index_01_l: the mannequin of the Unreal Engine
enum class BoneNames { skeletool, mixamo, vrm, unity, unreal };

/// The words by which an option names them, in the order of BoneNames.
const std::vector<std::string>& bone_names_words();
/// @param word one of bone_names_words
BoneNames bone_names_of(const std::string& word);

/// How the bones of a human are called. A part of the body has the name of Mixamo without prefix: Hips, Neck,
/// LeftForeArm, LeftHandIndex1; Spine, Spine1, ... Spine4 from below; Root for what is above the hips.
struct NameConvention {
  std::string prefix;                        ///< of all names
  std::map<std::string, std::string> names;  ///< by part of the body; parts without a name keep their own
  std::vector<std::string> required;         ///< parts without which programs do not take the bones for a human
};
/// @param names other than skeletool
const NameConvention& name_convention(BoneNames names);

/// The parts of the body that are no spine and no finger, hips first.
const std::vector<std::string>& body_parts();
/// The parts of the spine, from below.
const std::vector<std::string>& spine_parts();

/// The names in VRM (`leftIndexProximal`) of the bones of fingers, by those in Mixamo (`LeftHandIndex1`).
const std::map<std::string, std::string>& vrm_fingers();

}  // namespace doppel
