#include "doppel/io/motion_import/read_motion_file.h"

#include <array>
#include <utility>

#include "doppel/character/bvh.h"
#include "doppel/character/resample_motion.h"
#include "doppel/core/error.h"
#include "doppel/core/lower_case.h"
#include "doppel/io/motion_import/landmark_map.h"
#include "doppel/io/motion_import/marker_motion.h"
#include "doppel/io/motion_import/smpl_motion.h"
#include "doppel/io/motion_import/vertical.h"
#include "doppel/io/rig_import/motions_json.h"
#include "doppel/io/rig_import/rig_tracks.h"
#include "doppel/io/scene/read_scene.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

constexpr double kUsualRate = 25.0;

enum class MotionFormat { skeletool, bvh, rig, smpl, markers };

MotionFormat format_of(const fs::path& path) {
  const std::string extension = lower_case(path.extension().string());
  if (extension == ".motion") return MotionFormat::skeletool;
  if (extension == ".bvh") return MotionFormat::bvh;
  if (extension == ".npz") return MotionFormat::smpl;
  if (extension == ".c3d" || extension == ".trc") return MotionFormat::markers;
  for (const char* rig : {".glb", ".gltf", ".vrm", ".fbx", ".dae"})
    if (extension == rig) return MotionFormat::rig;
  fail<UsageError>(
      "{}: motions are read from .motion, .bvh, .glb, .gltf, .vrm, .fbx, .dae, .npz (AMASS, SMPL-X), .c3d and .trc "
      "files; "
      "this extension is not one of them",
      path.string());
}

SourceMotion read_rig_motion(const fs::path& path, const MotionFileOptions& options) {
  SceneLimits limits;
  limits.surface_needed = false;
  RigTracksOptions rig;
  rig.animation = options.source.animation;
  rig.metres_per_unit = options.source.metres_per_unit;
  rig.up = options.source.up;
  rig.frames_per_second = options.frames_per_second;
  const Scene scene = read_scene(path, limits);
  try {
    RigTracks read = rig_tracks(scene, rig);
    return {std::move(read.tracks), 0.1, std::move(read.warnings), {}};
  } catch (const UsageError& error) {
    fail<UsageError>("{}: {}", path.string(), error.what());
  }
}

/// The frames per second of a `.motion`, which the file does not state.
double rate_of_rows(const fs::path& path, const MotionFileOptions& options) {
  if (options.source.frames_per_second > 0) return options.source.frames_per_second;
  if (const std::optional<double> imported = imported_rate(path)) return *imported;
  return options.frames_per_second > 0 ? options.frames_per_second : kUsualRate;
}

/// A motion of the character itself.
MotionFromFile read_own_motion(const fs::path& path, const Character& character, const MotionFileOptions& options) {
  if (!options.map.empty())
    fail<UsageError>("--map is for motions of another skeleton; give a file of one, or --source-skeleton");
  const std::array<std::pair<const char*, bool>, 4> of_others{{{"--animation", !options.source.animation.empty()},
                                                               {"--person", !options.source.person.empty()},
                                                               {"--up", options.source.up.has_value()},
                                                               {"--unit", options.source.metres_per_unit.has_value()}}};
  for (const auto& [option, given] : of_others)
    if (given)
      fail<UsageError>(
          "{} is for files of another body; {} is a motion of the character itself, whose skeleton gives "
          "its axes and unit",
          option, path.string());
  const double rate = rate_of_rows(path, options);
  MotionFromFile result;
  result.frames_per_second = options.frames_per_second > 0 ? options.frames_per_second : rate;
  result.motion =
      resample(read_motion(path, character.num_dofs()), character.skeleton, rate / result.frames_per_second);
  return result;
}

/// The joints of a skeleton in a `.motion` or `.bvh` file.
SourceMotion read_skeleton_motion(const fs::path& path, const MotionFileOptions& options, MotionFormat format) {
  SourceMotion motion;
  if (format == MotionFormat::bvh) {
    motion.tracks = joint_tracks(read_bvh(path, options.source.metres_per_unit));
    return motion;
  }
  const Skeleton skeleton = read_skeleton(options.source_skeleton);
  motion.tracks = joint_tracks(skeleton, read_motion(path, skeleton.num_dofs()), rate_of_rows(path, options));
  return motion;
}

SourceMotion read_source(const fs::path& path, const MotionFileOptions& options, MotionFormat format) {
  switch (format) {
    case MotionFormat::rig:
      return read_rig_motion(path, options);
    case MotionFormat::smpl:
      return read_smpl_motion(path, options.source);
    case MotionFormat::markers:
      return read_marker_motion(path, options.source);
    default:
      return read_skeleton_motion(path, options, format);
  }
}

JointMap map_of_names_of(const Skeleton& skeleton, const JointTracks& source) {
  std::vector<std::string> joints;
  for (const Joint& joint : skeleton.joints) joints.push_back(joint.name);
  return guess_joint_map(joints, source.names);
}

/// Settles the vertical of a skeleton's motion: y and z by the map, which retargeting applies; others are turned here.
void settle_vertical(SourceMotion& source, JointMap& map, const Character& character, std::optional<char> given) {
  if (!given && map.z_up) return;
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  if (given) {
    up = Eigen::Vector3d::Unit(*given - 'x');
  } else {
    FoundVertical found = vertical_of(source_stance(character.skeleton, character.rest_dofs, source.tracks, map));
    up = found.axis;
    if (found.note) source.notes.push_back(std::move(*found.note));
    if (found.warning) source.warnings.push_back(std::move(*found.warning));
  }
  const bool z = up == Eigen::Vector3d::UnitZ();
  map.z_up.reset();  // a map cannot state another axis than y or z, which is found again
  if (z || up == Eigen::Vector3d::UnitY())
    map.z_up = z;
  else
    turn_to_y_up(source.tracks, up);
}

}  // namespace

bool is_foreign_motion(const fs::path& path) { return format_of(path) != MotionFormat::skeletool; }

MotionFromFile read_motion_file(const fs::path& path, const Character& character, const MotionFileOptions& options) {
  const MotionFormat format = format_of(path);
  if (format == MotionFormat::skeletool && options.source_skeleton.empty())
    return read_own_motion(path, character, options);
  if (!options.source.person.empty() && format != MotionFormat::markers)
    fail<UsageError>("--person chooses among the people of a C3D or TRC file; {} holds one", path.string());
  SourceMotion source = read_source(path, options, format);
  const bool by_names = format == MotionFormat::bvh || format == MotionFormat::skeletool;
  MotionFromFile result;
  JointMap map;
  if (!options.map.empty())
    map = read_joint_map(options.map);
  else
    map = by_names ? map_of_names_of(character.skeleton, source.tracks)
                   : landmark_joint_map(character.skeleton, character.rest_dofs, source.tracks);
  if (by_names)
    settle_vertical(source, map, character, options.source.up);
  else if (map.z_up.value_or(false))
    fail<UsageError>("{}: `up: z` is for BVH files; {} is brought to y up already, with --up if need be",
                     options.map.string(), path.string());
  if (options.map.empty()) result.guessed_map = map;
  RetargetOptions retargeting;
  retargeting.frames_per_second =
      options.frames_per_second > 0 ? options.frames_per_second : 1.0 / source.tracks.seconds_per_frame;
  retargeting.rest_dofs = character.rest_dofs;
  retargeting.rotation_weight = source.rotation_weight;
  result.retargeting = retarget(character.skeleton, source.tracks, map, retargeting);
  result.motion = std::move(result.retargeting->motion);
  result.frames_per_second = retargeting.frames_per_second;
  if (result.retargeting->rest_from_motion)
    source.notes.emplace_back(
        "the rest pose of the skeleton is no pose of a body (its limbs point elsewhere than those of the character), "
        "so "
        "one is found from the motion; the twist of limbs, head and hands is that of the motion up to a constant");
  result.notes = std::move(source.notes);
  result.warnings = std::move(source.warnings);
  return result;
}

}  // namespace doppel
