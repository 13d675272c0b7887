#include "doppel/actor/export/actor_file.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/render/splats/splat_rows.h"

namespace doppel {

void write_actor(const std::filesystem::path& path, const Character& character, const ActorDescription& description,
                 const ActorFunctions& functions, const ScriptModules& modules) {
  traced_actor(description, functions, modules).save(path, character, actor_metadata(character, description));
}

namespace {

template <typename T>
std::vector<T> array_of(const ScriptFile& file, const std::string& name, const std::filesystem::path& path) {
  const auto found = file.mesh.find(name);
  return found == file.mesh.end() ? std::vector<T>() : parse_npy(found->second, {path.string() + ": " + name}).as<T>();
}

/// @throws FileError when the arrays do not fit together
ActorTopology topology_of(const ScriptFile& file, const std::filesystem::path& path, std::int32_t num_vertices) {
  ActorTopology topology{array_of<std::int32_t>(file, "faces.npy", path), array_of<float>(file, "uvs.npy", path),
                         array_of<std::int32_t>(file, "face_uvs.npy", path)};
  const auto within = [](const std::vector<std::int32_t>& items, std::size_t end) {
    return std::all_of(items.begin(), items.end(), [end](std::int32_t i) { return i >= 0 && as_size(i) < end; });
  };
  if (topology.faces.size() % 3 != 0 || !within(topology.faces, as_size(num_vertices)) ||
      !within(topology.face_uvs, topology.uvs.size() / 2) ||
      (!topology.face_uvs.empty() && topology.face_uvs.size() != topology.faces.size()))
    fail_at({path.string()}, "its faces name vertices or UVs that do not exist; export the run again");
  return topology;
}

/// A result as the host will read it. A file could return anything.
torch::Tensor checked(const torch::jit::IValue& result, const std::vector<std::int64_t>& shape,
                      const std::string& name) {
  if (!result.isTensor() || result.toTensor().sizes() != shape || result.toTensor().scalar_type() != torch::kFloat32)
    fail("posing the actor {}: the file returns {}; float32 numbers of shape {} are expected. Export the run again",
         name, result.isTensor() ? fmt::to_string(fmt::join(result.toTensor().sizes().vec(), " x ")) : "no tensor",
         fmt::to_string(fmt::join(shape, " x ")));
  return result.toTensor().contiguous();
}

}  // namespace

ActorFile ActorFile::load(const std::filesystem::path& path) {
  ScriptFile file = load_script_file(path, ScriptKind::actor);
  ActorFile actor;
  try {
    ActorDescription& d = actor.description_;
    d.name = file.metadata.at("name");
    d.past_frames = metadata_integer(file.metadata.at("window"), path, "window", 1, kMaxScriptSide) - 1;
    d.dof_names = file.metadata.at("dof_names").get<std::vector<std::string>>();
    d.joint_names = file.metadata.at("joint_names").get<std::vector<std::string>>();
    d.num_vertices = metadata_integer(file.metadata.at("num_vertices"), path, "num_vertices", 1, kMaxScriptVertices);
    d.frames_per_second = file.metadata.at("frames_per_second");
    d.fingerprint = file.metadata.at("fingerprint");
    if (file.metadata.contains("texture"))
      d.texture_size = metadata_integer(file.metadata.at("texture").at("size"), path, "size", 1, kMaxScriptSide);
    if (file.metadata.contains("gaussians"))
      d.num_gaussians =
          metadata_integer(file.metadata.at("gaussians").at("count"), path, "count", 1, kMaxScriptVertices);
  } catch (const nlohmann::json::exception& e) {
    fail_metadata(path, ScriptKind::actor, e);
  }
  if (actor.description_.num_gaussians > 0 && !file.module.find_method("gaussians"))
    fail_at({path.string()}, "its metadata.json names Gaussians that the file does not hold; export the run again");
  actor.topology_ = topology_of(file, path, actor.description_.num_vertices);
  actor.file_ = std::move(file);
  return actor;
}

void ActorFile::check_window(const torch::Tensor& window) const {
  const auto dofs = static_cast<std::int64_t>(description_.dof_names.size());
  if (window.dim() != 3 || window.size(1) != description_.past_frames + 1 || window.size(2) != dofs)
    fail("posing the actor {}: it takes motion windows of shape [batch, {}, {}], found {}", description_.name,
         description_.past_frames + 1, dofs, fmt::to_string(fmt::join(window.sizes().vec(), " x ")));
}

torch::Tensor ActorFile::forward(const torch::Tensor& window) const {
  check_window(window);
  torch::NoGradGuard no_grad;
  return checked(file_.fastest().forward({window}), {window.size(0), description_.num_vertices, 3}, description_.name);
}

void ActorFile::check_view(const char* action, const torch::Tensor& window, const torch::Tensor& projection) const {
  check_window(window);
  if (projection.dim() != 3 || projection.size(0) != window.size(0) || projection.size(1) != 3 ||
      projection.size(2) != 4)
    fail("{} the actor {}: it takes a projection of shape [{}, 3, 4], found {}", action, description_.name,
         window.size(0), fmt::to_string(fmt::join(projection.sizes().vec(), " x ")));
}

void ActorFile::require_texture() const {
  if (description_.texture_size == 0)
    fail("texturing the actor {}: the file holds no dynamic texture; export a run whose TexNet is trained",
         description_.name);
}

std::pair<torch::Tensor, torch::Tensor> ActorFile::textured(const torch::Tensor& window,
                                                            const torch::Tensor& projection) const {
  require_texture();
  check_view("texturing", window, projection);
  torch::NoGradGuard no_grad;
  const torch::jit::IValue result = file_.fastest().get_method("textured")({window, projection});
  if (!result.isTuple() || result.toTupleRef().elements().size() != 2)
    fail("texturing the actor {}: the file does not return vertices and a texture; export the run again",
         description_.name);
  const auto& parts = result.toTupleRef().elements();
  const std::int64_t size = description_.texture_size;
  return {checked(parts[0], {window.size(0), description_.num_vertices, 3}, description_.name),
          checked(parts[1], {window.size(0), size, size, 3}, description_.name)};
}

torch::Tensor ActorFile::texture(const torch::Tensor& window, const torch::Tensor& projection,
                                 const torch::Tensor& vertices) const {
  require_texture();
  check_view("texturing", window, projection);
  torch::NoGradGuard no_grad;
  const auto method = file_.fastest().find_method("texture");
  if (!method) return textured(window, projection).second;  // a file of an earlier version
  const std::int64_t size = description_.texture_size;
  return checked((*method)({window, projection, vertices}), {window.size(0), size, size, 3}, description_.name);
}

torch::Tensor ActorFile::gaussians(const torch::Tensor& window, const torch::Tensor& projection,
                                   const torch::Tensor& vertices) const {
  if (description_.num_gaussians == 0)
    fail("the Gaussians of the actor {}: the file holds none; export a run whose stage gaussians is trained",
         description_.name);
  check_view("the Gaussians of", window, projection);
  torch::NoGradGuard no_grad;
  return checked(file_.fastest().get_method("gaussians")({window, projection, vertices}),
                 {window.size(0), description_.num_gaussians, kSplatColumns}, description_.name);
}

}  // namespace doppel
