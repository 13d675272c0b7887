#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/core/npy.h"
#include "doppel/geometry/mesh.h"
#include "doppel/rigging/joints/body_joints.h"
#include "doppel/rigging/weights/solid_grid.h"

namespace doppel::support {

/// The bodies whose joints mean the same as those of people.
inline const std::vector<std::string> kRealisticBodies{"m2m_female",      "m2m_male_apose",  "mh_girl_dress",
                                                       "mh_man_old_suit", "mh_man_workwear", "mh_woman_slim"};

/// A body of the shared folder with the joints of its own rig.
struct RiggedBody {
  std::string name;
  TriangleMesh mesh;
  BodyJoints joints;
  SolidGrid solid;
  nlohmann::json ground_truth;
  std::filesystem::path folder;
};

inline BodyJoints true_joints(const nlohmann::json& landmarks, double metres_per_unit) {
  BodyJoints joints;
  for (const auto& [name, value] : landmarks.items()) {
    if (value.is_null()) continue;
    const std::string full = name.starts_with("l_")   ? "left_" + name.substr(2)
                             : name.starts_with("r_") ? "right_" + name.substr(2)
                                                      : name;
    joints.positions[full] = metres_per_unit * Eigen::Vector3d(value[0], value[1], value[2]);
  }
  return joints;
}

inline RiggedBody read_rigged_body(const std::filesystem::path& bodies, const std::string& name, double cell = 0.01) {
  RiggedBody body;
  body.name = name;
  body.folder = bodies / name;
  body.mesh = read_obj(body.folder / "body.obj", 1.0);
  std::ifstream(body.folder / "truth.json") >> body.ground_truth;
  body.joints = true_joints(body.ground_truth["landmarks"], 1.0);
  VoxelSolidOptions options;
  options.cell = cell;
  body.solid = solid_grid(VoxelSolid(body.mesh, options));
  return body;
}

/// The named joint at which each bone of our skeleton begins, and the bone above it.
struct BoneStart {
  std::string bone, parent, joint;
};
inline std::vector<BoneStart> bone_starts() {
  std::vector<BoneStart> starts{{"Root", "", "pelvis"},       {"Spine", "Root", "spine"}, {"Spine1", "Spine", ""},
                                {"Chest", "Spine1", "chest"}, {"Neck", "Chest", "neck"},  {"Head", "Neck", "head"}};
  for (const std::string side : {"Left", "Right"}) {
    const std::string s = side == "Left" ? "l_" : "r_";
    starts.insert(starts.end(), {{side + "Shoulder", "Chest", s + "clavicle"},
                                 {side + "Arm", side + "Shoulder", s + "shoulder"},
                                 {side + "ForeArm", side + "Arm", s + "elbow"},
                                 {side + "ForeArmRoll", side + "ForeArm", ""},
                                 {side + "Hand", side + "ForeArmRoll", s + "wrist"},
                                 {side + "UpLeg", "Root", s + "hip"},
                                 {side + "Leg", side + "UpLeg", s + "knee"},
                                 {side + "Foot", side + "Leg", s + "ankle"},
                                 {side + "ToeBase", side + "Foot", s + "toe"}});
  }
  return starts;
}

/// What the rotations of `skin_check` do to our bones, when they turn at the body's true joints.
inline std::map<std::string, Eigen::Affine3d> skin_check_motions(const RiggedBody& body) {
  const nlohmann::json& rotations = body.ground_truth["skin_check"]["rotations"];
  std::map<std::string, Eigen::Affine3d> motions;
  for (const BoneStart& start : bone_starts()) {
    Eigen::Affine3d motion = start.parent.empty() ? Eigen::Affine3d::Identity() : motions.at(start.parent);
    if (rotations.contains(start.joint)) {
      const auto& p = body.ground_truth["landmarks"][start.joint];
      const auto& a = rotations[start.joint]["axis"];
      const Eigen::Vector3d position(p[0], p[1], p[2]), axis(a[0], a[1], a[2]);
      const double angle = rotations[start.joint]["degrees"].get<double>() * M_PI / 180;
      motion = motion * Eigen::Translation3d(position) * Eigen::AngleAxisd(angle, axis.normalized()) *
               Eigen::Translation3d(-position);
    }
    motions[start.bone] = motion;
  }
  return motions;
}

}  // namespace doppel::support
