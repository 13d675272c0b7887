#include "doppel/rigging/make_character.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/rigging/joints/body_skeleton.h"
#include "doppel/rigging/joints/fingers.h"
#include "doppel/rigging/joints/hinge_volume.h"
#include "doppel/rigging/joints/lone_triangles.h"
#include "doppel/rigging/weights/heat_weights.h"
#include "doppel/rigging/weights/solid_surface.h"

namespace doppel {
namespace {

/// The template itself can be decimated when it is one manifold part.
EmbeddedGraph graph_of(const TriangleMesh& mesh, const SolidGrid& solid, const CharacterOptions& options) {
  const int nodes = std::min(options.num_nodes, mesh.num_vertices());
  const MeshReport report = inspect_mesh(mesh);
  if (report.components == 1 && report.non_manifold_edges == 0 && report.isolated_vertices == 0) {
    try {
      return build_graph(mesh, nodes, options.graph);
    } catch (const Error&) {
      // Parts that touch in a vertex only. The surface of the solid serves as well.
    }
  }
  const TriangleMesh surface = solid_surface(solid);
  const bool coarse = surface.num_vertices() <= nodes;
  return build_graph(mesh, coarse ? surface : decimate(surface, nodes), options.graph);
}

}  // namespace

Character make_character(const std::string& name, const TriangleMesh& mesh, const BodyJoints& joints,
                         const SolidGrid& solid, const CharacterOptions& options) {
  Character character;
  character.name = name;
  character.mesh = mesh;
  character.options = options;
  BodySkeleton body = make_body_skeleton(joints);
  add_body_markers(body, joints, mesh);
  character.skeleton = std::move(body.skeleton);
  character.rest_dofs = std::move(body.rest_dofs);
  const std::vector<HeatBone> bones = heat_bones(joints);
  WeightField field = heat_field(mesh, bones, solid);
  std::vector<std::string> names;
  for (const HeatBone& bone : bones) names.push_back(bone.name);
  character.skin = sparse_weights(field, names);
  character.labels = region_labels(mesh, character.skin, joints);
  character.graph = graph_of(mesh, solid, character.options);
  complete_character(character);
  keep_hinge_volumes(field, character);
  set_smooth_skin(character, field);
  divide_hand_weights(character, joints);
  return character;
}

}  // namespace doppel
