#include "doppel/export/actor_file.h"

#include <fmt/ranges.h>

#include "doppel/core/error.h"

namespace doppel {
namespace {

using torch::jit::Stack;

constexpr double kActorTraceTolerance = 1e-5;  // metres: the accuracy that a host can rely on
// For colours 0..1, a quarter of an 8-bit step: if a vertex of a small face is off by kActorTraceTolerance, its normal
// changes the colour by this much.
constexpr double kColourTolerance = 1e-3;

/// Random poses around the pose in which all DoFs are 0. @return [batch, window, D]
torch::Tensor random_windows(const ActorDescription& description, int num_dofs, int batch, std::uint64_t seed) {
  return 0.3 * torch::randn({batch, description.past_frames + 1, num_dofs}, at::detail::createCPUGenerator(seed));
}

/// Cameras some metres away that point roughly at the origin. @return [batch,3,4]
torch::Tensor random_projections(int batch, std::uint64_t seed) {
  torch::Tensor projection = 0.1 * torch::randn({batch, 3, 4}, at::detail::createCPUGenerator(seed));
  projection +=
      torch::tensor({500.0f, 0.0f, 256.0f, 900.0f, 0.0f, 500.0f, 256.0f, 700.0f, 0.0f, 0.0f, 1.0f, 3.0f}).view({3, 4});
  return projection;
}

void add_geometry(ScriptFileWriter& file, const ActorDescription& description, int num_dofs,
                  const ActorFunction& geometry) {
  const auto function = [&](const Stack& inputs) -> Stack { return {geometry(inputs.at(0).toTensor())}; };
  file.add("forward", {random_windows(description, num_dofs, 1, 1)}, function);
  file.check("forward", {random_windows(description, num_dofs, 3, 2)}, function, {kActorTraceTolerance});
}

void add_texture(ScriptFileWriter& file, const ActorDescription& description, int num_dofs,
                 const ActorFunctions& functions) {
  const auto function = [&](const Stack& inputs) -> Stack {
    const torch::Tensor window = inputs.at(0).toTensor();
    const torch::Tensor texture = functions.texture(window, inputs.at(1).toTensor());
    return {functions.geometry(window), texture};
  };
  file.add("textured", {random_windows(description, num_dofs, 1, 3), random_projections(1, 3)}, function);
  file.check("textured", {random_windows(description, num_dofs, 2, 4), random_projections(2, 4)}, function,
             {kActorTraceTolerance, kColourTolerance});
}

}  // namespace

void write_actor(const std::filesystem::path& path, const Character& character, const ActorDescription& description,
                 const ActorFunctions& functions, const ScriptModules& modules) {
  ScriptFileWriter file(ScriptKind::actor, modules);
  add_geometry(file, description, character.num_dofs(), functions.geometry);
  if (functions.texture) add_texture(file, description, character.num_dofs(), functions);
  file.save(path, character, actor_metadata(character, description));
}

ActorFile ActorFile::load(const std::filesystem::path& path) {
  ScriptFile file = load_script_file(path, ScriptKind::actor);
  ActorFile actor;
  actor.module_ = file.module;
  try {
    ActorDescription& d = actor.description_;
    d.name = file.metadata.at("name");
    d.past_frames = file.metadata.at("window").get<int>() - 1;
    d.dof_names = file.metadata.at("dof_names").get<std::vector<std::string>>();
    d.joint_names = file.metadata.at("joint_names").get<std::vector<std::string>>();
    d.num_vertices = file.metadata.at("num_vertices");
    d.frames_per_second = file.metadata.at("frames_per_second");
    d.fingerprint = file.metadata.at("fingerprint");
    if (file.metadata.contains("texture")) d.texture_size = file.metadata.at("texture").at("size");
  } catch (const nlohmann::json::exception& e) {
    fail_metadata(path, ScriptKind::actor, e);
  }
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
  return module_.forward({window}).toTensor();
}

std::pair<torch::Tensor, torch::Tensor> ActorFile::textured(const torch::Tensor& window,
                                                            const torch::Tensor& projection) const {
  check_window(window);
  if (description_.texture_size == 0)
    fail("texturing the actor {}: the file contains its geometry only; export a run whose TexNet is trained",
         description_.name);
  if (projection.dim() != 3 || projection.size(0) != window.size(0) || projection.size(1) != 3 ||
      projection.size(2) != 4)
    fail("texturing the actor {}: it takes a projection of shape [{}, 3, 4], found {}", description_.name,
         window.size(0), fmt::to_string(fmt::join(projection.sizes().vec(), " x ")));
  torch::NoGradGuard no_grad;
  const auto result = module_.get_method("textured")({window, projection}).toTuple();
  return {result->elements()[0].toTensor(), result->elements()[1].toTensor()};
}

}  // namespace doppel
