#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/io/scene/scene.h"

namespace doppel {

struct ImportRigOptions {
  std::string name = "actor";             ///< of the character and its files
  std::vector<std::string> animations;    ///< names of the file; empty: all
  std::optional<double> metres_per_unit;  ///< default: as the file says, else guessed by the height
  std::optional<char> up;                 ///< 'x', 'y' or 'z'; default: as the file says, else y
  double frames_per_second = 0.0;         ///< of the motions; 0: see sampling_rate
  std::optional<double> joint_limit = 3.14159265358979323846;  ///< +- radians of each rotation but the root's, or none
  int nodes = 500;                                             ///< of the embedded graph
  bool weld = false;  ///< joins vertices that coincide, in all poses, with others
};

/// An animation of the file as a motion of the character. Row f is the pose at `start + f / frames_per_second`.
struct ImportedMotion {
  std::string animation;  ///< its name in the file
  std::string file;       ///< `walk.motion`: the name with characters that a file name cannot have replaced
  Motion motion;
  double frames_per_second = 0.0;
  double start = 0.0;  ///< seconds on the file's time axis
  /// Largest distance of a vertex, posed by the character, from the vertex posed by the file, over some frames: metres.
  double error = 0.0;
};

/// A joint of the file and the joints of the character that are made of it.
struct ImportedJoint {
  std::string name;          ///< in the file
  std::string bone;          ///< in the character: the joints are `<bone>_tx`, ..., `<bone>_rz`
  int parent = -1;           ///< ImportedJoint
  Eigen::Vector3d position;  ///< in the bind pose, character metres
};

struct ImportedRig {
  Character character;  ///< complete; its weights are those of the file, for linear blend skinning
  std::vector<ImportedMotion> motions;
  std::vector<int> vertex_map;        ///< [N] vertex of the file, counted over all primitives of the scene
  std::vector<ImportedJoint> joints;  ///< parents first
  std::vector<int> landmark_joint;    ///< [kBodyLandmarks] joint, or -1
  Eigen::Affine3d file_from_character = Eigen::Affine3d::Identity();
  std::vector<std::string> warnings;  ///< of the scene and of the conversion
};

/// The rate of an animation's keys: the lowest usual rate that has a frame at each of them; 0: none has.
double key_rate(const SceneAnimation& animation);

/// The rate at which an animation is sampled when none is given: a multiple of the rate of its keys, so that every key
/// has its frame, and so dense that a straight line between two frames is exact to a tenth of a millimetre.
double sampling_rate(const SceneAnimation& animation);

/// The rigged figure of a scene as a character in metres with y up, and its animations as motions.
///
/// The template is the surface in the bind pose, and every DoF is 0 there. A joint of the file becomes a run of
/// rotations about the world's axes at its position, after translations where an animation moves the joint in its
/// parent. The root has three translations and three rotations. The weights are for linear blending. Primitives without
/// a skin follow the joint above them.
/// @throws UsageError for an animation that the scene does not have, or that has no keys; Error when the scene has no
///   skin, when joints are sheared or mirrored so that no skeleton can hold them, or when an animation lasts for hours
ImportedRig import_rig(const Scene& scene, const ImportRigOptions& options = {});

/// Writes `<name>.character` with all it names, the motions, `vertex_map.npy`, `joints.json` and `motions.json`.
/// @return the path of the `.character` file @throws as write_character_folder
std::filesystem::path write_imported_rig(const std::filesystem::path& folder, const ImportedRig& rig);

}  // namespace doppel
