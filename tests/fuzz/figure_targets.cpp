// Rigged figures as characters, and motions of other bodies.

#include <array>
#include <cmath>

#include "doppel/character/bvh.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/io/motion_import/landmark_map.h"
#include "doppel/io/motion_import/marker_motion.h"
#include "doppel/io/motion_import/smpl_motion.h"
#include "doppel/io/rig_import/import_rig.h"
#include "doppel/io/rig_import/motions_json.h"
#include "doppel/io/rig_import/rig_tracks.h"
#include "doppel/io/scene/read_scene.h"
#include "fuzz/fuzz_target.h"
#include "io/motion_import/motion_writers.h"
#include "io/motion_import/test_figure.h"
#include "support/fbx_writer.h"
#include "support/gltf_writer.h"

namespace doppel::fuzz {
namespace {

using Path = std::filesystem::path;

/// Small, so that an import takes milliseconds.
SceneLimits rig_limits(bool surface_needed) {
  return {.vertices = 500,
          .triangles = 500,
          .nodes = 100,
          .keys = 2'000,
          .image_side = 64,
          .surface_needed = surface_needed};
}

void check_motion(const ImportedMotion& imported, const Character& character, const Path& folder) {
  const Motion& motion = imported.motion;
  promise(motion.num_frames() > 0 && motion.ids.size() == motion.frames.size(), "each frame has an id");
  for (const auto& frame : motion.frames) {
    promise(frame.size() == as_size(character.num_dofs()), "frames have all DoFs");
    for (const double value : frame) promise(std::isfinite(value), "DoFs are finite");
  }
  promise(imported.frames_per_second > 0 && std::isfinite(imported.start), "a motion has a rate and a start");
  const auto rate = imported_rate(folder / imported.file);
  promise(rate && std::abs(*rate - imported.frames_per_second) <= 1e-12 * *rate, "the rate survives");
  const Motion again = read_motion(folder / imported.file, character.num_dofs());
  promise(again.num_frames() == motion.num_frames(), "all frames survive");
  for (std::size_t f = 0; f < motion.frames.size(); ++f)
    for (std::size_t d = 0; d < motion.frames[f].size(); ++d)
      promise(std::abs(again.frames[f][d] - motion.frames[f][d]) <= 1e-8 * std::abs(motion.frames[f][d]),
              "DoFs survive");
}

void read_motions_bytes(std::string_view bytes, const Path& folder) {
  written(bytes, folder, "motions.json");
  const auto rate = imported_rate(folder / "walk.motion");
  promise(!rate || (*rate > 0 && std::isfinite(*rate)), "a rate is positive");
}

/// A rigged figure becomes a character that survives writing and reading.
void import_bytes(std::string_view bytes, const Path& folder, const char* name) {
  ImportRigOptions options;
  options.nodes = 20;
  const Scene scene = read_scene(written(bytes, folder, name), rig_limits(true));
  const ImportedRig rig = import_rig(scene, options);
  promise(rig.vertex_map.size() == as_size(rig.character.num_vertices()), "each vertex has one of the file");
  for (const int vertex : rig.vertex_map) promise(vertex >= 0 && vertex < scene.num_vertices(), "which exists");
  for (std::size_t j = 0; j < rig.joints.size(); ++j)
    promise(rig.joints[j].parent < static_cast<int>(j) && rig.joints[j].position.allFinite(), "joints are sound");
  for (const int joint : rig.landmark_joint)
    promise(joint >= -1 && joint < static_cast<int>(rig.joints.size()), "landmarks have joints");
  std::filesystem::remove_all(folder / "actor");
  const Character again = load_character(write_imported_rig(folder / "actor", rig));
  promise(again.fingerprint() == rig.character.fingerprint(), "the character survives");
  for (const ImportedMotion& motion : rig.motions) check_motion(motion, rig.character, folder / "actor");
}

void check_tracks(const JointTracks& tracks) {
  const std::size_t count = tracks.names.size();
  promise(count > 0 && tracks.parents.size() == count && tracks.rest.size() == count, "each joint has a parent");
  promise(tracks.seconds_per_frame > 0 && std::isfinite(tracks.seconds_per_frame), "time runs");
  for (std::size_t j = 0; j < count; ++j)
    promise(tracks.parents[j] >= -1 && tracks.parents[j] < static_cast<int>(j) && tracks.rest[j].matrix().allFinite(),
            "parents come first");
  for (const auto& frame : tracks.frames) {
    promise(frame.size() == count, "each joint has a transform");
    for (const Eigen::Affine3d& transform : frame) promise(transform.matrix().allFinite(), "transforms are finite");
  }
}

/// What comes between a reader and retargeting: pairing with a character, and another rate.
void check_use(const JointTracks& tracks) {
  constexpr double kRate = 30, kMaxFrames = 1000;
  check_tracks(tracks);
  if (tracks.num_frames() * tracks.seconds_per_frame * kRate < kMaxFrames) check_tracks(resample(tracks, kRate));
  static const Character character = support::tall_character();
  JointMap map;
  try {
    map = landmark_joint_map(character.skeleton, character.rest_dofs, tracks);
  } catch (const Error&) {
    return;  // the joints are not those of a body
  }
  promise(map.pairs.size() >= 5, "at least five joints are paired");
  for (const JointMap::Pair& pair : map.pairs)
    promise(std::find(tracks.names.begin(), tracks.names.end(), pair.source) != tracks.names.end(),
            "joints of the motion exist");
}

using Reader = JointTracks (*)(const Path&);

JointTracks tracks_of_rig(const Path& path) { return rig_tracks(read_scene(path, rig_limits(false))).tracks; }
JointTracks tracks_of_smpl(const Path& path) { return read_smpl_motion(path, {}).tracks; }
JointTracks tracks_of_markers(const Path& path) { return read_marker_motion(path, {}).tracks; }
JointTracks tracks_of_bvh(const Path& path) { return joint_tracks(read_bvh(path)); }

FuzzTarget motion_target(const char* name, const char* file, Reader read, std::vector<std::string> seeds,
                         std::vector<std::string> dictionary, Unwrap unwrap = {}) {
  const auto run = [=](std::string_view bytes, const Path& folder) { check_use(read(written(bytes, folder, file))); };
  return {name, run, std::move(seeds), std::move(dictionary), std::move(unwrap)};
}

std::string smpl_motion(bool deflated) {
  support::NpzWriter file(deflated);
  std::vector<double> poses(3 * 66, 0.0);
  for (std::size_t i = 66; i < poses.size(); ++i) poses[i] = 0.01 * static_cast<double>(i % 7);
  file.add("poses", poses, {3, 66});
  file.add("trans", {0, 0, 1, 0, 0.1, 1, 0, 0.2, 1}, {3, 3});
  file.add("mocap_framerate", {60}, {});
  return file.bytes();
}

struct Point {
  const char* name;
  double x, z;  ///< millimetres
};
constexpr std::array<Point, 14> kBody{{{"LHip", 90, 950},
                                       {"RHip", -90, 950},
                                       {"LKnee", 100, 500},
                                       {"RKnee", -100, 500},
                                       {"LAnkle", 110, 80},
                                       {"RAnkle", -110, 80},
                                       {"Neck", 0, 1500},
                                       {"Head", 0, 1700},
                                       {"LShoulder", 180, 1450},
                                       {"RShoulder", -180, 1450},
                                       {"LElbow", 450, 1450},
                                       {"RElbow", -450, 1450},
                                       {"LWrist", 700, 1450},
                                       {"RWrist", -700, 1450}}};

std::string c3d_motion(double scale) {
  support::C3dWriter file;
  file.scale = scale;
  for (int f = 0; f < 3; ++f) {
    file.frames.emplace_back();
    for (const Point& point : kBody) file.frames.back().emplace_back(point.x, 10.0 * f, point.z);
  }
  for (const Point& point : kBody) file.labels.emplace_back(point.name);
  return file.bytes();
}

std::string trc_motion() {
  std::string names = "Frame#\tTime", axes = "\t", rows;
  for (const Point& point : kBody) {
    names += "\t" + std::string(point.name) + "\t\t";
    axes += "\tX\tY\tZ";
  }
  for (int f = 0; f < 3; ++f) {
    rows += std::to_string(f + 1) + "\t" + std::to_string(0.01 * f);
    for (const Point& point : kBody)
      rows += "\t" + std::to_string(point.x) + "\t" + std::to_string(point.z) + "\t" + std::to_string(10 * f);
    rows += "\n";
  }
  return "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n100\t100\t3\t" +
         std::to_string(kBody.size()) + "\tmm\n" + names + "\n" + axes + "\n\n" + rows;
}

constexpr const char* kBvh =
    "HIERARCHY\nROOT Hips {\n OFFSET 0 90 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    " JOINT LeftUpLeg { OFFSET 9 0 0 CHANNELS 3 Zrotation Xrotation Yrotation\n"
    "  JOINT LeftLeg { OFFSET 0 -45 0 CHANNELS 3 Zrotation Xrotation Yrotation\n"
    "   JOINT LeftFoot { OFFSET 0 -40 0 CHANNELS 3 Zrotation Xrotation Yrotation End Site { OFFSET 0 0 15 } } } }\n"
    " JOINT Spine { OFFSET 0 10 0 CHANNELS 3 Zrotation Xrotation Yrotation\n"
    "  JOINT Neck { OFFSET 0 45 0 CHANNELS 3 Zrotation Xrotation Yrotation\n"
    "   JOINT Head { OFFSET 0 10 0 CHANNELS 3 Zrotation Xrotation Yrotation End Site { OFFSET 0 15 0 } } } } }\n"
    "MOTION\nFrames: 2\nFrame Time: 0.04\n";

std::string bvh_motion() {
  std::string row;
  for (int i = 0; i < 24; ++i) row += (i > 0 ? " " : "") + std::to_string(i);
  return kBvh + row + "\n" + row + "\n";
}

const std::vector<std::string> kGltfWords{"\"sparse\":{\"count\":1}",
                                          "\"matrix\"",
                                          "\"children\":[1,2]",
                                          "\"skin\":0",
                                          "\"mesh\":0",
                                          "\"inverseBindMatrices\":1",
                                          "\"normalized\":true,",
                                          "CUBICSPLINE",
                                          "STEP",
                                          "\"path\":\"scale\"",
                                          "\"translation\":",
                                          "[0,0,0]",
                                          "1e300",
                                          "-1"};
const std::vector<std::string> kFbxWords{
    "C: \"OO\",1,1\n", "C: \"OO\",2,3\n",      "nan",
    "1e300",           "PreRotation",          "P: \"Lcl Scaling\", \"\", \"\", \"A\",0,-1,2\n",
    "RotationOrder",   "GeometricTranslation", "AnimationCurve",
    "*2 { a: 1,2 }"};

}  // namespace

std::vector<FuzzTarget> figure_targets() {
  const std::string glb = support::bending_arm().glb(), fbx = support::fbx_text(support::fbx_arm());
  return {{"rig_glb",
           [](std::string_view bytes, const Path& folder) { import_bytes(bytes, folder, "a.glb"); },
           {glb},
           kGltfWords,
           unwrap_glb},
          {"rig_fbx",
           [](std::string_view bytes, const Path& folder) { import_bytes(bytes, folder, "a.fbx"); },
           {fbx},
           kFbxWords},
          {"motions_json",
           read_motions_bytes,
           {R"({"motions":[{"file":"walk.motion","animation":"walk","frames_per_second":30.0}]})"},
           {"[[[[", "{\"a\":", "null", "1e999", "-1", "\"motions\":[", "\"file\":", "\"walk.motion\""}},
          motion_target("motion_glb", "a.glb", tracks_of_rig, {glb}, kGltfWords, unwrap_glb),
          motion_target("motion_fbx", "a.fbx", tracks_of_rig, {fbx}, kFbxWords),
          motion_target("motion_bvh", "a.bvh", tracks_of_bvh, {bvh_motion()},
                        {"JOINT RightUpLeg {\n", "End Site {\n", "}\n", "OFFSET 0 1 0\n", "CHANNELS 3 ", "Xrotation",
                         "Frames: ", "Frame Time: ", "1e300", "1e-300"}),
          motion_target("motion_smpl", "a.npz", tracks_of_smpl, {smpl_motion(false), smpl_motion(true)},
                        {"root_orient.npy", "pose_body.npy", "global_orient.npy", "transl.npy", "fps.npy",
                         "'shape': (3, 22, 3)", "PK\x01\x02", "<f4"},
                        unwrap_zip),
          motion_target("motion_c3d", "a.c3d", tracks_of_markers, {c3d_motion(-1), c3d_motion(0.1)},
                        {"POINT", "SCALE", "LASI", "LKNE", "LABELS", "UNITS", "RATE", "Y_SCREEN", "+Y", "-Z"}),
          motion_target("motion_trc", "a.trc", tracks_of_markers, {trc_motion()},
                        {"LASI", "LKNE", "Subject:", "nan", "1e300", "\t\t", "NumFrames", "Units", "m", "cm"})};
}

}  // namespace doppel::fuzz
