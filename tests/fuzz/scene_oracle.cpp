#include "fuzz/scene_oracle.h"

#include <cmath>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/io/scene/scene_mesh.h"
#include "fuzz/fuzz_target.h"

namespace doppel::fuzz {

namespace {

template <typename T>
bool is_index(int value, const std::vector<T>& of) {
  return value >= 0 && as_size(value) < of.size();
}

template <typename Rows>
bool all_finite(const Rows& rows) {
  for (const auto& row : rows)
    if (!row.allFinite()) return false;
  return true;
}

void check_nodes(const Scene& scene) {
  std::set<std::string> names;
  for (const SceneNode& node : scene.nodes) {
    promise(!node.name.empty() && names.insert(node.name).second, "names of nodes are unique and not empty");
    promise(node.parent == -1 || is_index(node.parent, scene.nodes), "parents are nodes");
    std::size_t steps = 0;
    for (int n = node.parent; n >= 0; n = scene.nodes[n].parent)
      promise(++steps <= scene.nodes.size(), "nodes form no circle");
    promise(node.translation.allFinite() && node.rotation.coeffs().allFinite() && node.scale.allFinite() &&
                node.before.matrix().allFinite() && node.between.matrix().allFinite() &&
                node.after.matrix().allFinite(),
            "transforms of nodes are finite");
  }
}

void check_skin_of(const Scene& scene, const ScenePrimitive& primitive) {
  if (primitive.skin < 0) return promise(primitive.weights.empty(), "weights belong to a skin");
  promise(is_index(primitive.skin, scene.skins), "skins exist");
  const auto& joints = scene.skins[primitive.skin].joints;
  const IndexRows& rows = primitive.vertex_joints;
  promise(rows.offsets.size() == primitive.vertices.size() + 1, "each vertex has a row of joints");
  promise(rows.items.size() == primitive.weights.size(), "each joint of a vertex has a weight");
  for (int v = 0; v < primitive.num_vertices(); ++v) {
    double sum = 0.0;
    for (int i = rows.offsets[v]; i < rows.offsets[as_size(v) + 1]; ++i) {
      promise(is_index(rows.items[i], joints), "joints of vertices are in the skin");
      promise(primitive.weights[i] >= 0, "weights are not negative");
      sum += primitive.weights[i];
    }
    promise(rows.size(v) == 0 || std::abs(sum - 1) < 1e-6, "weights sum to 1");
  }
}

void check_primitive(const Scene& scene, const ScenePrimitive& primitive) {
  promise(is_index(primitive.node, scene.nodes), "primitives have a node");
  promise(primitive.material >= -1 && (primitive.material == -1 || is_index(primitive.material, scene.materials)),
          "materials of primitives exist");
  promise(primitive.face_materials.empty() || primitive.face_materials.size() == primitive.faces.size(),
          "each face has a material, or none has");
  for (const int material : primitive.face_materials)
    promise(material == -1 || is_index(material, scene.materials), "materials of faces exist");
  promise(all_finite(primitive.vertices), "vertices are finite");
  promise(all_finite(primitive.uvs), "UVs are finite");
  promise(primitive.colours.empty() || primitive.colours.size() == primitive.vertices.size(),
          "each vertex has a colour, or none has");
  for (const Eigen::Vector3d& colour : primitive.colours)
    promise(colour.minCoeff() >= 0 && colour.maxCoeff() <= 1, "colours are in 0..1");
  promise(primitive.face_uvs.empty() || primitive.face_uvs.size() == primitive.faces.size(),
          "each face has UVs, or none has");
  for (const Triangle& face : primitive.faces)
    for (const int v : face) promise(is_index(v, primitive.vertices), "corners are vertices");
  for (const Triangle& face : primitive.face_uvs)
    for (const int uv : face) promise(is_index(uv, primitive.uvs), "UVs of corners exist");
  check_skin_of(scene, primitive);
}

void check_animation(const Scene& scene, const SceneAnimation& animation) {
  promise(!animation.name.empty(), "animations have names");
  promise(std::isfinite(animation.start) && animation.start <= animation.end, "animations start before they end");
  for (const SceneChannel& channel : animation.channels) {
    promise(is_index(channel.node, scene.nodes), "channels move nodes");
    const std::size_t each = channel.interpolation == SceneChannel::Interpolation::cubic ? 3 : 1;
    promise(!channel.times.empty() && channel.values.size() == each * channel.times.size(), "keys have values");
    promise(all_finite(channel.values), "values of keys are finite");
    for (std::size_t k = 1; k < channel.times.size(); ++k)
      promise(channel.times[k] > channel.times[k - 1], "times ascend");
  }
  for (const double seconds : {animation.start - 1, 0.5 * (animation.start + animation.end), animation.end})
    promise(node_transforms(scene, animation, seconds).size() == scene.nodes.size(), "each node has a transform");
}

void check_mesh(const Scene& scene) {
  SceneMeshOptions options;
  options.atlas_side = 512;
  const TriangleMesh mesh = scene_mesh(scene, options);
  promise(mesh.num_vertices() == scene.num_vertices() && mesh.num_faces() == scene.num_faces(),
          "the mesh holds all primitives");
  promise(mesh.texture.cols <= 16384 && mesh.texture.rows <= 16384, "the texture stays small");
  check_triangles(mesh);
}

}  // namespace

void check_scene(const Scene& scene, const SceneLimits& limits) {
  promise(scene.num_faces() > 0, "there are triangles");
  promise(scene.num_vertices() <= limits.vertices && scene.num_faces() <= limits.triangles &&
              scene.nodes.size() <= as_size(limits.nodes),
          "limits are kept");
  promise(!scene.metres_per_unit || (*scene.metres_per_unit > 0 && std::isfinite(*scene.metres_per_unit)),
          "units are positive");
  check_nodes(scene);
  for (const SceneSkin& skin : scene.skins) {
    promise(skin.joints.size() == skin.joint_from_mesh.size(), "each joint has a bind matrix");
    for (const int joint : skin.joints) promise(is_index(joint, scene.nodes), "joints are nodes");
  }
  for (const ScenePrimitive& primitive : scene.primitives) check_primitive(scene, primitive);
  for (const SceneMaterial& material : scene.materials)
    promise(material.colour.allFinite() && material.colour.minCoeff() >= 0 && material.colour.maxCoeff() <= 1,
            "colours of materials are in 0..1");
  for (const SceneAnimation& animation : scene.animations) check_animation(scene, animation);
  check_mesh(scene);
}

void check_triangles(const TriangleMesh& mesh) {
  promise(!mesh.faces.empty(), "there are triangles");
  promise(all_finite(mesh.vertices), "vertices are finite");
  promise(all_finite(mesh.uvs), "UVs are finite");
  promise(mesh.colours.empty() || mesh.colours.size() == mesh.vertices.size(), "each vertex has a colour, or none has");
  promise(mesh.face_uvs.empty() || mesh.face_uvs.size() == mesh.faces.size(), "each face has UVs, or none has");
  for (const Triangle& face : mesh.faces)
    for (const int v : face) promise(is_index(v, mesh.vertices), "corners are vertices");
  for (const Triangle& face : mesh.face_uvs)
    for (const int uv : face) promise(is_index(uv, mesh.uvs), "UVs of corners exist");
}

}  // namespace doppel::fuzz
