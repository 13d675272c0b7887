#include "doppel/actor/export/actor_trace.h"

namespace doppel {
namespace {

using torch::jit::Stack;

void add_geometry(ScriptFileWriter& file, const ActorDescription& description, const ActorFunction& geometry) {
  const auto function = [&](const Stack& inputs) -> Stack { return {geometry(inputs.at(0).toTensor())}; };
  file.add("forward", {random_windows(description, 1, 1)}, function);
  file.check("forward", {random_windows(description, 3, 2)}, function, {kTraceTolerance});
}

void add_textured(ScriptFileWriter& file, const ActorDescription& description, const ActorFunctions& functions) {
  const auto function = [&](const Stack& inputs) -> Stack {
    const torch::Tensor window = inputs.at(0).toTensor(), vertices = functions.geometry(window);
    return {vertices, functions.texture(window, inputs.at(1).toTensor(), vertices)};
  };
  file.add("textured", {random_windows(description, 1, 3), random_projections(1, 3)}, function);
  file.check("textured", {random_windows(description, 2, 4), random_projections(2, 4)}, function,
             {kTraceTolerance, kTraceColourTolerance});
}

/// Adds the look as the method `name`, for vertices at hand. @param compared as ScriptFileWriter::check
void add_look(ScriptFileWriter& file, const char* name, const ActorDescription& description,
              const ActorFunction& geometry, const LookFunction& look,
              const ScriptFileWriter::Compared& compared = nullptr) {
  const ScriptFileWriter::Function function = look_method(look);
  file.add(name, look_inputs(description, geometry, 1, 3), function);
  file.check(name, look_inputs(description, geometry, 2, 4), function, {kTraceColourTolerance}, compared);
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

ScriptFileWriter::Function look_method(const LookFunction& look) {
  return [look](const Stack& inputs) -> Stack {
    return {look(inputs.at(0).toTensor(), inputs.at(1).toTensor(), inputs.at(2).toTensor())};
  };
}

Stack look_inputs(const ActorDescription& description, const ActorFunction& geometry, int batch, std::uint64_t seed) {
  const torch::Tensor window = random_windows(description, batch, seed);
  return {window, random_projections(batch, seed), geometry(window)};
}

torch::Tensor comparable_gaussians(const torch::Tensor& rows) {
  std::vector<torch::Tensor> parts{10 * rows.narrow(2, 0, 3), 10 * rows.narrow(2, 7, 3), rows.narrow(2, 10, 4)};
  for (int i = 3; i < 7; ++i) parts.push_back(rows.narrow(2, i, 7 - i) * rows.narrow(2, i, 1));
  return torch::cat(parts, 2);
}

ScriptFileWriter traced_actor(const ActorDescription& description, const ActorFunctions& functions,
                              const ScriptModules& modules) {
  ScriptFileWriter file(ScriptKind::actor, modules);
  add_geometry(file, description, functions.geometry);
  if (functions.texture) {
    add_textured(file, description, functions);
    add_look(file, "texture", description, functions.geometry, functions.texture);
  }
  if (functions.gaussians)
    add_look(file, "gaussians", description, functions.geometry, functions.gaussians, comparable_gaussians);
  return file;
}

}  // namespace doppel
