#include "doppel/actor/export/actor_trace.h"

namespace doppel {
namespace {

using torch::jit::Stack;

constexpr double kActorTraceTolerance = 1e-5;  // metres: the accuracy that a host can rely on
// For colours 0..1, a quarter of an 8-bit step: if a vertex of a small face is off by kActorTraceTolerance, its normal
// changes the colour by this much.
constexpr double kColourTolerance = 1e-3;

void add_geometry(ScriptFileWriter& file, const ActorDescription& description, const ActorFunction& geometry) {
  const auto function = [&](const Stack& inputs) -> Stack { return {geometry(inputs.at(0).toTensor())}; };
  file.add("forward", {random_windows(description, 1, 1)}, function);
  file.check("forward", {random_windows(description, 3, 2)}, function, {kActorTraceTolerance});
}

void add_texture(ScriptFileWriter& file, const ActorDescription& description, const ActorFunctions& functions) {
  const auto function = [&](const Stack& inputs) -> Stack {
    const torch::Tensor window = inputs.at(0).toTensor(), vertices = functions.geometry(window);
    return {vertices, functions.texture(window, inputs.at(1).toTensor(), vertices)};
  };
  file.add("textured", {random_windows(description, 1, 3), random_projections(1, 3)}, function);
  file.check("textured", {random_windows(description, 2, 4), random_projections(2, 4)}, function,
             {kActorTraceTolerance, kColourTolerance});
  const auto texture = [&](const Stack& inputs) -> Stack {
    return {functions.texture(inputs.at(0).toTensor(), inputs.at(1).toTensor(), inputs.at(2).toTensor())};
  };
  const auto surface_inputs = [&](int batch, std::uint64_t seed) -> Stack {
    const torch::Tensor window = random_windows(description, batch, seed);
    return {window, random_projections(batch, seed), functions.geometry(window)};
  };
  file.add("texture", surface_inputs(1, 3), texture);
  file.check("texture", surface_inputs(2, 4), texture, {kColourTolerance});
}

}  // namespace

torch::Tensor random_windows(const ActorDescription& description, int batch, std::uint64_t seed) {
  const auto num_dofs = static_cast<std::int64_t>(description.dof_names.size());
  return 0.3 * torch::randn({batch, description.past_frames + 1, num_dofs}, at::detail::createCPUGenerator(seed));
}

torch::Tensor random_projections(int batch, std::uint64_t seed) {
  torch::Tensor projection = 0.1 * torch::randn({batch, 3, 4}, at::detail::createCPUGenerator(seed));
  projection +=
      torch::tensor({500.0f, 0.0f, 256.0f, 900.0f, 0.0f, 500.0f, 256.0f, 700.0f, 0.0f, 0.0f, 1.0f, 3.0f}).view({3, 4});
  return projection;
}

ScriptFileWriter traced_actor(const ActorDescription& description, const ActorFunctions& functions,
                              const ScriptModules& modules) {
  ScriptFileWriter file(ScriptKind::actor, modules);
  add_geometry(file, description, functions.geometry);
  if (functions.texture) add_texture(file, description, functions);
  return file;
}

}  // namespace doppel
