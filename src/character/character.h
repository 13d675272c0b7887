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
  int num_nodes = 500;  ///< of a graph built here, when no graph OBJ lies beside the character
  RigidityPreset rigidity = RigidityPreset::graph;
};

/// What is known of the actor before any frame. Immutable once built; everything else takes it by const reference.
struct Character {
  std::string name;
  TriangleMesh mesh;  ///< the template in the rest pose, world metres
  Skeleton skeleton;
  SkinningWeights skin;
  std::vector<int> bone_joint;    ///< [Bn] joint that carries each bone
  std::vector<double> rest_dofs;  ///< [D] the pose the template was scanned in
  EmbeddedGraph graph;
  std::vector<int> labels;       ///< [N] LIP labels, or empty
  std::vector<double> rigidity;  ///< [N] s_i
  CharacterOptions options;
  std::filesystem::path graph_source;  ///< the graph OBJ, or empty when decimated here

  int num_vertices() const { return mesh.num_vertices(); }
  int num_nodes() const { return graph.num_nodes(); }
  int num_dofs() const { return skeleton.num_dofs(); }
  /// A digest of everything that shapes a model (topology, skin, graph, DoFs): 16 hex digits. Checkpoints carry it.
  std::string fingerprint() const;
};

/// Completes a character built in code from its name, mesh, skeleton, skin, rest pose, labels and options: finds the
/// joint of each bone, the rigidity, and a zero rest pose where none is given. The graph is left alone.
/// @throws Error when counts disagree or no joint carries a bone
void complete_character(Character& character);

/// How far, in metres, the markers lie from the template in the rest pose under either reading (median).
struct MarkerDistances {
  double joint_relative = 0.0, zero_pose_world = 0.0;
};
/// Chooses the reading of the marker coordinates under which they lie nearer the template. Without markers nothing
/// changes.
MarkerDistances decide_marker_reading(Skeleton& skeleton, const std::vector<double>& rest_dofs,
                                      const TriangleMesh& mesh);

/// How far, in metres, the joints that carry bones lie from the template's vertices in the rest pose (median): some
/// centimetres, unless the rest pose or a unit is wrong.
double skeleton_distance(const Character& character);
/// Farther than this (skeleton_distance) and the skeleton is not in the body.
constexpr double kSkeletonOffTemplate = 0.2;

/// Reads "skeletool character file v1.0" and what it names; beside it, by convention, `segmentation.txt` and a graph
/// OBJ
/// (`<stem>_graph.obj`, `<stem>Simplified.obj`, `simplified.obj`, `*_graph.obj`). Decides the marker reading by which
/// one lies nearer the template in the rest pose, checks that all counts agree, and warns when the skeleton does not
/// lie in the template.
/// @throws FileError / Error naming the two files that disagree
Character load_character(const std::filesystem::path& path, const CharacterOptions& options = {});

/// Writes the character as a folder of Skeletool files: `<name>.{character,skeleton,skin,obj,mtl,png,motion}`,
/// `<name>_graph.obj`, `segmentation.txt`. Reading it back gives the same character.
/// @return the path of the `.character` file
std::filesystem::path write_character(const std::filesystem::path& folder, const Character& character);

}  // namespace doppel
