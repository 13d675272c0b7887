#pragma once

#include <Eigen/Geometry>
#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// Named joints of a body in its rest pose: metres, world, y up. The names are those of `body_joint_names` and, where
/// they are known, those of `extra_point_names`. Left is the body's own left.
struct BodyJoints {
  std::map<std::string, Eigen::Vector3d> positions;

  bool has(const std::string& name) const { return positions.count(name) != 0; }
  /// @throws Error naming the missing joint
  const Eigen::Vector3d& at(const std::string& name) const;
};

/// The 21 joints of the contract: pelvis, spine, chest, neck, head, and left_/right_ clavicle, shoulder, elbow, wrist,
/// hip, knee, ankle, toe. `toe` is the joint at the ball of the foot, `head` the joint between neck and head.
const std::vector<std::string>& body_joint_names();
/// The twelve joints that must be given: shoulders, elbows, wrists, hips, knees, ankles.
const std::vector<std::string>& limb_joint_names();
/// Points that help where they are known: head_top, nose, left_/right_ eye, ear, hand (the knuckle of the middle
/// finger), fingertip (of the middle finger), toe_end, heel, and the points of the fingers (`finger_point`).
const std::vector<std::string>& extra_point_names();

/// A finger: its name in the points of BodyJoints, and in the names of bones.
struct Finger {
  const char* point;
  const char* bone;
};
inline constexpr std::array<Finger, 5> kFingers{{{"thumb", "Thumb"},
                                                 {"forefinger", "Index"},
                                                 {"middle_finger", "Middle"},
                                                 {"ring_finger", "Ring"},
                                                 {"pinky_finger", "Pinky"}}};
inline constexpr int kFingerPoints = 4;

/// "left_forefinger2". Point 1 is the knuckle (of the thumb: the joint at the wrist), 2 and 3 are the joints of the
/// finger, 4 is the tip.
/// @param side "left_" or "right_" @param k 1 to 4
std::string finger_point(const std::string& side, const Finger& finger, int k);
/// Whether all 20 points of the fingers of a hand are known. @param side "left_" or "right_"
bool has_fingers(const BodyJoints& joints, const std::string& side);

/// The same name on the other side of the body: `left_knee` for `right_knee`; the name itself without a side.
std::string other_side(const std::string& name);

/// The directions of a body, unit vectors in the world, from hips, shoulders and pelvis.
struct BodyFrame {
  Eigen::Vector3d left, up, forward;
};
/// The frame of the pelvis: `left` from hip to hip, `up` towards the middle of the shoulders.
/// @throws Error when a hip or shoulder is missing, or they have no extent
BodyFrame pelvis_frame(const BodyJoints& joints);
/// The frame of the chest: `left` from shoulder to shoulder, `up` away from the middle of the hips.
BodyFrame chest_frame(const BodyJoints& joints);

/// Adds the joints that are missing beside the twelve of the limbs, and the points hand, fingertip, head_top and
/// toe_end, by the proportions of an adult's body; hand and fingertip by the fingers, where these are known. Joints
/// that are given do not change.
/// @throws Error when one of the twelve is missing
void complete_joints(BodyJoints& joints);

/// What is implausible about joints: a sentence each, empty when all is well. Checks the lengths of bones against the
/// trunk and against the other side, the order of joints from pelvis to head, left and right swapped, and finiteness.
std::vector<std::string> examine_joints(const BodyJoints& joints);

/// A file of joints: `{"file_from_character": 4x4, "joints": {"pelvis": [x, y, z], ...}}`. The positions in the file
/// are in the coordinates and the unit of the scan's file.
struct JointsFile {
  Eigen::Affine3d file_from_character = Eigen::Affine3d::Identity();  ///< from metres to the file's coordinates
  BodyJoints joints;                                                  ///< metres
};

/// Reads a file of joints. `l_` and `r_` are read as `left_` and `right_`; a joint that is `null` is absent.
/// @param file_from_character of the scan, used when the file has none
/// @throws FileError: not JSON, no `joints`, an unknown or a repeated name, not three finite numbers, a matrix that is
///   not a scale, rotation and translation, or no matrix at all
JointsFile read_joints(const std::filesystem::path& path,
                       const std::optional<Eigen::Affine3d>& file_from_character = std::nullopt);
/// Writes those of the 21 joints and of the points of fingers that are known. Reading the file gives the same positions
/// to within a micrometre.
void write_joints(const std::filesystem::path& path, const JointsFile& file);

}  // namespace doppel
