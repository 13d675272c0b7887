#include "doppel/actor/export/actor_weights.h"

#include <algorithm>

#include "doppel/core/atomic_file.h"
#include "doppel/nets/weights/weights_file.h"

namespace doppel {

namespace {

/// The tensors of the character with what each of them is.
struct CharacterTensors {
  NamedWeights tensors;
  nlohmann::ordered_json meaning = nlohmann::ordered_json::object();

  template <typename T>
  void add(const std::string& name, const std::vector<T>& values, const std::vector<std::int64_t>& shape,
           const std::string& what) {
    const bool whole = std::is_integral_v<T>;
    torch::Tensor tensor = torch::empty(shape, whole ? torch::kInt32 : torch::kFloat32);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (whole)
        tensor.data_ptr<std::int32_t>()[i] = static_cast<std::int32_t>(values[i]);
      else
        tensor.data_ptr<float>()[i] = static_cast<float>(values[i]);
    }
    tensors.emplace_back(name, tensor);
    meaning[name] = what;
  }
};

/// The numbers of points or index tuples, one after the other.
template <typename Rows>
auto flat(const Rows& rows, int width) {
  std::vector<std::decay_t<decltype(rows[0][0])>> values;
  for (const auto& row : rows)
    for (int i = 0; i < width; ++i) values.push_back(row[static_cast<Eigen::Index>(i)]);
  return values;
}

std::int64_t count(std::size_t size) { return static_cast<std::int64_t>(size); }

void add_template(const Character& character, CharacterTensors& all) {
  const TriangleMesh& mesh = character.mesh;
  all.add("template.vertices", flat(mesh.vertices, 3), {count(mesh.vertices.size()), 3}, "rest pose, world metres");
  all.add("template.faces", flat(mesh.faces, 3), {count(mesh.faces.size()), 3}, "counter-clockwise from outside");
  if (mesh.uvs.empty()) return;
  all.add("template.uvs", flat(mesh.uvs, 2), {count(mesh.uvs.size()), 2}, "u to the right, v upwards");
  all.add("template.face_uvs", flat(mesh.face_uvs, 3), {count(mesh.face_uvs.size()), 3}, "rows of template.uvs");
}

void add_skin(const Character& character, CharacterTensors& all) {
  const IndexRows& rows = character.skin.vertex_bones;
  all.add("skin.offsets", rows.offsets, {count(rows.offsets.size())},
          "vertex i has the entries offsets[i] to offsets[i+1]");
  all.add("skin.bones", rows.items, {count(rows.items.size())}, "bone of an entry");
  all.add("skin.weights", character.skin.weights, {count(rows.items.size())}, "weight of an entry");
  all.add("skin.bone_joint", character.bone_joint, {count(character.bone_joint.size())}, "joint that carries a bone");
}

void add_skeleton(const Character& character, CharacterTensors& all) {
  std::vector<int> parent, slides, dof, joint;
  std::vector<Eigen::Vector3d> offset, axis;
  std::vector<double> weight;
  for (const Joint& entry : character.skeleton.joints) {
    parent.push_back(entry.parent);
    slides.push_back(entry.type == Joint::Type::prismatic ? 1 : 0);
    offset.push_back(entry.offset);
    axis.push_back(entry.axis);
  }
  for (std::size_t d = 0; d < character.skeleton.dofs.size(); ++d)
    for (const Dof::Drive& drive : character.skeleton.dofs[d].joints) {
      dof.push_back(static_cast<int>(d));
      joint.push_back(drive.joint);
      weight.push_back(drive.weight);
    }
  const std::int64_t joints = count(parent.size()), drives = count(dof.size());
  all.add("skeleton.parent", parent, {joints}, "parent of a joint, always before it; -1 for the root");
  all.add("skeleton.slides", slides, {joints}, "1: the joint moves along its axis; 0: it turns about it");
  all.add("skeleton.offset", flat(offset, 3), {joints, 3}, "to the parent, metres");
  all.add("skeleton.axis", flat(axis, 3), {joints, 3}, "unit vector, or metres per unit for a joint that slides");
  all.add("skeleton.drive_dof", dof, {drives}, "the value of a joint is the sum of weight * DoF over its drives");
  all.add("skeleton.drive_joint", joint, {drives}, "joint of a drive");
  all.add("skeleton.drive_weight", weight, {drives}, "weight of a drive");
  all.add("skeleton.rest_dofs", character.rest_dofs, {count(character.rest_dofs.size())}, "pose of the template");
}

void add_graph(const Character& character, CharacterTensors& all) {
  const EmbeddedGraph& graph = character.graph;
  all.add("graph.node_vertex", graph.node_vertex, {count(graph.node_vertex.size())}, "template vertex of a node");
  all.add("graph.edges", flat(graph.edges, 2), {count(graph.edges.size()), 2}, "pairs of neighbouring nodes");
  all.add("graph.offsets", graph.vertex_nodes.offsets, {count(graph.vertex_nodes.offsets.size())},
          "vertex i has the entries offsets[i] to offsets[i+1]");
  all.add("graph.nodes", graph.vertex_nodes.items, {count(graph.vertex_nodes.items.size())}, "node of an entry");
  all.add("graph.weights", graph.weights, {count(graph.weights.size())}, "weight of an entry");
}

void add_networks(const ScriptModules& modules, const QuantizedWeights& quantized, NamedWeights& tensors) {
  const auto add = [&](const std::string& name, const torch::Tensor& tensor) {
    const QuantizedWeight* weight = quantized.find(tensor);
    tensors.emplace_back(name, weight ? weight->values : tensor);
    if (weight && weight->scale.defined()) tensors.emplace_back(weight->scale_name(), weight->scale);
  };
  for (const auto& [prefix, module] : modules) {
    for (const auto& entry : module->named_parameters()) add(prefix + "." + entry.key(), entry.value());
    for (const auto& entry : module->named_buffers()) add(prefix + "." + entry.key(), entry.value());
  }
  std::stable_sort(tensors.begin(), tensors.end(),
                   [](const auto& a, const auto& b) { return a.second.element_size() > b.second.element_size(); });
}

}  // namespace

void write_actor_weights(const std::filesystem::path& path, const Character& character,
                         const ActorDescription& description, const ScriptModules& modules,
                         const QuantizedWeights& quantized) {
  CharacterTensors all;
  add_template(character, all);
  add_skin(character, all);
  add_skeleton(character, all);
  add_graph(character, all);
  add_networks(modules, quantized, all.tensors);
  nlohmann::ordered_json about = actor_metadata(character, description);
  about["skinning"] = character.skinning == SkinningMode::linear ? "linear" : "dual_quaternion";
  about["tensors"] = all.meaning;
  if (!quantized.all().empty()) about["quantized"] = quantized.metadata();
  write_safetensors(path, all.tensors, {{"format", "doppel-actor"}, {"name", description.name}});
  write_atomically(std::filesystem::path(path).replace_extension(".json"), about.dump(2) + "\n");
}

}  // namespace doppel
