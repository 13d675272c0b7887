#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/character/embedded_graph.h"
#include "doppel/character/motion.h"
#include "doppel/character/rigidity.h"
#include "doppel/character/skeleton.h"
#include "doppel/character/skinning_weights.h"
#include "doppel/geometry/mesh.h"

namespace doppel {

struct CharacterOptions {
  BoneRule bone_rule = BoneRule::exact;
  GraphOptions graph;
  int num_nodes = 500;  ///< of the graph that is built when no graph OBJ lies beside the character
  RigidityPreset rigidity = RigidityPreset::graph;
};

/// What is known of a person before any frame is seen. Immutable once built; other code takes it by const reference.
struct Character {
  std::string name;
  TriangleMesh mesh;  ///< the template in the rest pose, world metres
  Skeleton skeleton;
  SkinningWeights skin;
  SkinningMode skinning =
      SkinningMode::dual_quaternion;  ///< of the vertices; graph nodes always blend dual quaternions
  std::vector<int> bone_joint;        ///< [Bn] joint that carries each bone
  std::vector<double> rest_dofs;      ///< [D] the pose the template was scanned in
  EmbeddedGraph graph;
  std::vector<int> labels;       ///< [N] LIP labels, or empty
  std::vector<double> rigidity;  ///< [N] s_i
  CharacterOptions options;
  std::filesystem::path graph_source;  ///< the graph OBJ, or empty when the graph was built by decimation

  int num_vertices() const { return mesh.num_vertices(); }
  int num_nodes() const { return graph.num_nodes(); }
  int num_dofs() const { return skeleton.num_dofs(); }
  /// A digest of what determines the shapes of networks (topology, skin, graph, DoFs) and the skinning mode: 16 hex
  /// digits. Checkpoints hold it.
  std::string fingerprint() const;
};

/// Completes a character built in code from its name, mesh, skeleton, skin, rest pose, labels and options. Sets the
/// joint of each bone, the rigidity, and a zero rest pose if none is given. The graph does not change.
/// @throws Error when counts disagree or no joint carries a bone
void complete_character(Character& character);

/// Median distance of the markers from the template in the rest pose under each reading, metres.
struct MarkerDistances {
  double joint_relative = 0.0, zero_pose_world = 0.0;
};
/// Chooses the reading of the marker coordinates under which the markers lie nearer to the template. Without markers
/// nothing changes.
MarkerDistances decide_marker_reading(Skeleton& skeleton, const std::vector<double>& rest_dofs,
                                      const TriangleMesh& mesh);

/// Median distance of the joints that carry bones from the template's vertices in the rest pose, metres. It is some
/// centimetres, unless the rest pose or a unit is wrong.
double skeleton_distance(const Character& character);
/// A skeleton_distance above this value means that the skeleton is not inside the body, metres.
constexpr double kSkeletonOffTemplate = 0.2;

/// Reads a "skeletool character file v1.0" and the files that it names. The keyword `skinning`, with the line `linear`
/// or `dual_quaternion` (the default) after it, is an extension of Doppel. By convention, `segmentation.txt` and a
/// graph OBJ (`<stem>_graph.obj`, `<stem>Simplified.obj`, `simplified.obj`, `*_graph.obj`) are read from the same
/// folder. Chooses the marker reading (decide_marker_reading), checks that all counts agree, and warns when the
/// skeleton does not lie inside the template.
/// @throws FileError / Error naming the two files that disagree
Character load_character(const std::filesystem::path& path, const CharacterOptions& options = {});

/// The joints and DoFs of a `.character` file; the other files that it names must exist, but are not read.
/// @throws FileError as load_character
Skeleton read_character_skeleton(const std::filesystem::path& path);

/// Writes the character as a folder of Skeletool files. They are `<name>.{character,skeleton,skin,obj,mtl,png,motion}`,
/// `<name>_graph.obj` and `segmentation.txt`. Reading the folder back gives the same character.
/// @return the path of the `.character` file
std::filesystem::path write_character(const std::filesystem::path& folder, const Character& character);

}  // namespace doppel
