#include <algorithm>
#include <cmath>

#include "doppel/character/bvh.h"
#include "doppel/character/character.h"
#include "doppel/character/joint_map.h"
#include "doppel/character/labels.h"
#include "doppel/character/landmarks.h"
#include "doppel/character/motion.h"
#include "doppel/character/rigidity.h"
#include "doppel/character/skeleton.h"
#include "doppel/character/skinning_weights.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/rigging/joints/body_joints.h"
#include "fuzz/fuzz_target.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::fuzz {

namespace {

using Path = std::filesystem::path;

constexpr int kDofs = 4;  // of the seeds

bool all_finite(const std::vector<double>& values) {
  for (const double value : values)
    if (!std::isfinite(value)) return false;
  return true;
}

void read_skeleton_bytes(std::string_view bytes, const Path& folder) {
  const Skeleton skeleton = read_skeleton(written(bytes, folder, "a.skeleton"));
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const Joint& joint = skeleton.joints[j];
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
    for (int i = skin.vertex_bones.offsets[v]; i < skin.vertex_bones.offsets[as_size(v) + 1]; ++i) {
      const int bone = skin.vertex_bones.items[i];
      promise(bone >= 0 && bone < skin.num_bones(), "weights belong to bones");
      sum += skin.weights[i];
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

const std::vector<const char*> kCharacterFiles{"tube.character", "tube.skeleton",  "tube.skin",       "tube.obj",
                                               "tube.motion",    "tube_graph.obj", "segmentation.txt"};

const Character& small_character() {
  static const Character character = make_test_character(2, 4, 3);
  return character;
}

void check_character(const Character& character) {
  const auto vertices = as_size(character.num_vertices());
  promise(as_size(character.skin.num_vertices()) == vertices && character.rigidity.size() == vertices &&
              (character.labels.empty() || character.labels.size() == vertices),
          "each vertex has weights, a rigidity and perhaps a label");
  promise(character.rest_dofs.size() == as_size(character.num_dofs()) && all_finite(character.rest_dofs),
          "the rest pose is whole");
  promise(character.bone_joint.size() == as_size(character.skin.num_bones()), "each bone has a joint");
  for (const int joint : character.bone_joint)
    promise(joint >= 0 && joint < character.skeleton.num_joints(), "joints of bones exist");
  for (const int vertex : character.graph.node_vertex)
    promise(vertex >= 0 && as_size(vertex) < vertices, "graph nodes are vertices");
}

/// A character with all its files, which survives writing and reading.
void read_character_bytes(std::string_view bytes, const Path& folder) {
  const Path path = spread(bytes, folder, kCharacterFiles);
  for (const char* name : kCharacterFiles)
    if (std::filesystem::is_empty(folder / name)) std::filesystem::remove(folder / name);
  const Character character = load_character(path);
  check_character(character);
  promise(read_character_skeleton(path).num_dofs() == character.num_dofs(), "the skeleton alone is the same");
  if (character.graph.faces.empty()) return;  // cannot be written
  std::filesystem::remove_all(folder / "again");
  const Character again = load_character(write_character(folder / "again", character));
  promise(again.fingerprint() == character.fingerprint(), "a character survives writing and reading");
  promise(again.labels == character.labels && again.skinning == character.skinning, "labels and skinning survive");
}

void read_landmark_bytes(std::string_view bytes, const Path& folder) {
  const Character& character = small_character();
  const std::vector<Marker> landmarks = read_landmarks(written(bytes, folder, "a.csv"), character);
  const auto positions = landmark_positions(character.skeleton, landmarks, character.rest_dofs);
  write_landmarks(folder / "again.csv", character, landmarks);
  const auto again = read_landmarks(folder / "again.csv", character);
  const auto positions_again = landmark_positions(character.skeleton, again, character.rest_dofs);
  promise(again.size() == landmarks.size(), "landmarks survive");
  for (std::size_t m = 0; m < landmarks.size(); ++m)
    promise(again[m].name == landmarks[m].name && again[m].joint == landmarks[m].joint &&
                (positions_again[m] - positions[m]).norm() <= 2e-9 + 1e-12 * positions[m].norm(),
            "names, joints and positions survive");
}

void read_segmentation_bytes(std::string_view bytes, const Path& folder) {
  const std::vector<int> labels = read_segmentation(written(bytes, folder, "segmentation.txt"), 3);
  promise(labels.size() == 3, "each vertex has a label");
  for (const int label : labels) promise(label >= 0 && label < kNumLabels, "labels are known");
  write_segmentation(folder / "again.txt", labels);
  promise(read_segmentation(folder / "again.txt", 3) == labels, "labels survive");
}

void read_joint_map_bytes(std::string_view bytes, const Path& folder) {
  const JointMap map = read_joint_map(written(bytes, folder, "a.yaml"));
  promise(!map.pairs.empty() && map.factor > 0, "a map pairs joints");
  const JointMap again = read_joint_map(written(joint_map_text(map), folder, "again.yaml"));
  promise(again.pairs.size() == map.pairs.size() && again.scale == map.scale && again.z_up == map.z_up &&
              std::abs(again.factor - map.factor) <= 1e-5 * map.factor,
          "scale and axis survive");
  // YAML holds text alone, so bytes that are no UTF-8 are replaced when a map is written.
  const auto is_plain = [](const std::string& name) {
    return std::all_of(name.begin(), name.end(), [](char c) { return c >= ' ' && c < '\x7f'; });
  };
  for (std::size_t i = 0; i < map.pairs.size(); ++i)
    if (is_plain(map.pairs[i].target) && is_plain(map.pairs[i].source))
      promise(again.pairs[i].target == map.pairs[i].target && again.pairs[i].source == map.pairs[i].source &&
                  (again.pairs[i].rest_rotation - map.pairs[i].rest_rotation).norm() < 1e-5,
              "pairs survive");
}

/// A root that moves along and turns about y, and a knee.
Skeleton small_skeleton() {
  Skeleton skeleton;
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero(), x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
  skeleton.joints = {{"root_tx", Joint::Type::prismatic, -1, zero, 0.001 * x},
                     {"root_ty", Joint::Type::prismatic, 0, zero, 0.001 * y},
                     {"root_ry", Joint::Type::revolute, 1, zero, y},
                     {"knee_rx", Joint::Type::revolute, 2, Eigen::Vector3d(0.1, -0.4, 0), x}};
  for (int j = 0; j < 4; ++j) skeleton.dofs.push_back({skeleton.joints[j].name, {{j, 1.0}}, {}});
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

std::string small_character_files() {
  const support::TemporaryFolder folder;
  write_character(folder.path(), small_character());
  std::vector<std::string> files;
  for (const char* name : kCharacterFiles) files.push_back(read_file(folder / name));
  return joined(files);
}

std::string small_landmarks() {
  const Skeleton& skeleton = small_character().skeleton;
  return bytes_of("a.csv", [&](const Path& path) {
    write_landmarks(path, small_character(), {{"nose", skeleton.num_joints() - 1, {0.1, 0.2, 0.3}, 0.01}});
  });
}

constexpr const char* kJointMap =
    "joints:\n  Root: Hips\n  LeftArm: LeftUpperArm\nscale: 0.5\nup: z\nrest_rotation:\n  LeftArm: [0, 0, 45]\n";

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
       {"{\"a\":", "[[[[", "null", "\"l_knee\"", "\"joints\":{", "\"file_from_character\":", "1e999"}},
      {"character",
       read_character_bytes,
       {small_character_files()},
       {"skinning\n  linear\n", "skinning", "pose", "skin", "mesh", "skeleton", kNextFile, "/dev/zero", "..", "nan",
        "1e300", "dofs: 0", "f 1 2 3\n", "v 0 0 0\n", "20\n"}},
      {"landmarks",
       read_landmark_bytes,
       {small_landmarks()},
       {"index,name,joint,x_mm,y_mm,z_mm", "1,nose", "Root_tx", "1e308", "nan", ",,", "\xEF\xBB\xBF"}},
      {"segmentation", read_segmentation_bytes, {"0\n5\n20\n"}, {"21", "-1", "\n\n", "1.5", "1e9"}},
      {"joint_map",
       read_joint_map_bytes,
       {kJointMap, "joints: {a: b}\nscale: hip_height\nup: y\n"},
       {"leg_length", "hip_height", "rest_rotation:", "joints:", "scale: ", "&a ", "*a", "'#'", "\": \"", "null", "~",
        "1e308", "!!str ", "[0, 0, 360]"}}};
}

}  // namespace doppel::fuzz
