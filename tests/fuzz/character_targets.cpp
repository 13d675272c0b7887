#include <cmath>

#include "doppel/character/bvh.h"
#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"
#include "doppel/character/skinning_weights.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/rigging/body_joints.h"
#include "fuzz/fuzz_target.h"
#include "support/temporary_folder.h"

namespace doppel::fuzz {

namespace {

using Path = std::filesystem::path;

constexpr int kDofs = 4;  // of the seeds

/// The bytes that a writer of the library makes.
template <typename Write>
std::string bytes_of(const char* name, const Write& write) {
  const support::TemporaryFolder folder;
  write(folder / name);
  return read_file(folder / name);
}

bool all_finite(const std::vector<double>& values) {
  for (const double value : values)
    if (!std::isfinite(value)) return false;
  return true;
}

void read_skeleton_bytes(std::string_view bytes, const Path& folder) {
  const Skeleton skeleton = read_skeleton(written(bytes, folder, "a.skeleton"));
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const Joint& joint = skeleton.joints[as_size(j)];
    promise(joint.parent >= -1 && joint.parent < j, "parents come before children");
    promise(joint.offset.allFinite() && joint.axis.allFinite(), "joints are finite");
  }
  for (const Dof& dof : skeleton.dofs)
    for (const Dof::Drive& drive : dof.joints)
      promise(drive.joint >= 0 && drive.joint < skeleton.num_joints() && std::isfinite(drive.weight),
              "DoFs drive joints");
  for (const Marker& marker : skeleton.markers)
    promise(marker.joint >= 0 && marker.joint < skeleton.num_joints() && marker.position.allFinite(),
            "markers have a joint");
  promise(as_size(skeleton.num_joints()) == skeleton.pose(std::vector<double>(skeleton.dofs.size(), 0.1)).size(),
          "each joint has a pose");
}

void read_skin_bytes(std::string_view bytes, const Path& folder) {
  const SkinningWeights skin = read_skin(written(bytes, folder, "a.skin"));
  for (int v = 0; v < skin.num_vertices(); ++v) {
    double sum = 0.0;
    for (int i = skin.vertex_bones.offsets[as_size(v)]; i < skin.vertex_bones.offsets[as_size(v) + 1]; ++i) {
      const int bone = skin.vertex_bones.items[as_size(i)];
      promise(bone >= 0 && bone < skin.num_bones(), "weights belong to bones");
      sum += skin.weights[as_size(i)];
    }
    promise(std::abs(sum - 1) < 1e-9, "weights sum to 1");
  }
}

void read_motion_bytes(std::string_view bytes, const Path& folder) {
  const Motion motion = read_motion(written(bytes, folder, "a.motion"), kDofs);
  promise(motion.num_frames() > 0 && motion.ids.size() == motion.frames.size(), "each frame has an id");
  for (const auto& frame : motion.frames) promise(frame.size() == kDofs && all_finite(frame), "frames are whole");
}

void read_bvh_bytes(std::string_view bytes, const Path& folder) {
  const BvhClip clip = read_bvh(written(bytes, folder, "a.bvh"));
  promise(std::isfinite(clip.seconds_per_frame) && clip.seconds_per_frame > 0, "time runs");
  for (std::size_t j = 0; j < clip.joints.size(); ++j)
    promise(clip.joints[j].parent < static_cast<int>(j) && clip.joints[j].offset.allFinite(), "joints are sound");
  for (const auto& frame : clip.frames)
    promise(static_cast<int>(frame.size()) == clip.num_channels() && all_finite(frame), "frames are whole");
  if (!clip.frames.empty()) promise(clip.pose(clip.frames[0]).size() == clip.joints.size(), "each joint has a pose");
}

void read_joints_bytes(std::string_view bytes, const Path& folder) {
  const JointsFile file = read_joints(written(bytes, folder, "joints.json"));
  promise(file.file_from_character.matrix().allFinite(), "the transform is finite");
  promise(file.file_from_character.linear().determinant() > 0, "the transform does not mirror");
}

/// A root that moves along and turns about y, and a knee.
Skeleton small_skeleton() {
  Skeleton skeleton;
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero(), x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
  skeleton.joints = {{"root_tx", Joint::Type::prismatic, -1, zero, 0.001 * x},
                     {"root_ty", Joint::Type::prismatic, 0, zero, 0.001 * y},
                     {"root_ry", Joint::Type::revolute, 1, zero, y},
                     {"knee_rx", Joint::Type::revolute, 2, Eigen::Vector3d(0.1, -0.4, 0), x}};
  for (int j = 0; j < 4; ++j) skeleton.dofs.push_back({skeleton.joints[as_size(j)].name, {{j, 1.0}}, {}});
  skeleton.dofs[3].limits = {0.0, 2.5};
  skeleton.markers = {{"ankle", 3, Eigen::Vector3d(0, -0.4, 0), 0.01}};
  return skeleton;
}

SkinningWeights small_skin() {
  SkinningWeights skin;
  skin.bones = {"root", "knee"};
  skin.vertex_bones.items = {0, 0, 1, 1};
  skin.vertex_bones.offsets = {0, 1, 3, 4};
  skin.weights = {1.0, 0.75, 0.25, 1.0};
  return skin;
}

BvhClip small_clip() {
  BvhClip clip;
  const auto position = BvhChannel::x_position;
  clip.joints = {{"Hips", -1, Eigen::Vector3d(0, 0.9, 0), {position, BvhChannel::y_rotation}},
                 {"Knee", 0, Eigen::Vector3d(0.1, -0.4, 0), {BvhChannel::x_rotation}},
                 {"Knee_end", 1, Eigen::Vector3d(0, -0.4, 0), {}}};
  clip.frames = {{0, 0, 0}, {0.5, 0.25, 1}};
  return clip;
}

JointsFile small_joints() {
  JointsFile file;
  file.file_from_character = Eigen::Affine3d::Identity();
  file.joints.positions = {{"left_hip", {0.1, 0.9, 0}}, {"left_knee", {0.1, 0.5, 0}}, {"neck", {0, 1.5, 0}}};
  return file;
}

}  // namespace

std::vector<FuzzTarget> character_targets() {
  const Motion motion{{{0, 1, 2, 3}, {4, 5, 6, 7}}, {0, 1}};
  return {
      {"skeleton",
       read_skeleton_bytes,
       {bytes_of("a.skeleton", [](const Path& path) { write_skeleton(path, small_skeleton()); })},
       {"prismatic", "revolute", "limits", "nolimits", "channel", "marker", "joints:", "dofs:", "knee_rx", "scale"}},
      {"skin",
       read_skin_bytes,
       {bytes_of("a.skin", [](const Path& path) { write_skin(path, small_skin()); })},
       {"bones:", "vertex weights:", "root", "knee", "0 0 1.0", "nan"}},
      {"motion",
       read_motion_bytes,
       {bytes_of("a.motion", [&](const Path& path) { write_motion(path, motion); })},
       {"Skeletool Motion File V0.1", "1e308", "-1", "nan"}},
      {"bvh",
       read_bvh_bytes,
       {bytes_of("a.bvh", [](const Path& path) { write_bvh(path, small_clip()); })},
       {"JOINT a\n{\n", "End Site\n{\n", "}\n", "OFFSET 0 1 0\n", "CHANNELS 3 ", "Xrotation",
        "Frames: ", "Frame Time: ", "MOTION\n"}},
      {"joints",
       read_joints_bytes,
       {bytes_of("joints.json", [](const Path& path) { write_joints(path, small_joints()); })},
       {"{\"a\":", "[[[[", "null", "\"l_knee\"", "\"joints\":{", "\"file_from_character\":", "1e999"}}};
}

}  // namespace doppel::fuzz
