#include "doppel/actor/export/onnx_file.h"

#include "doppel/actor/export/pose_trace.h"
#include "doppel/actor/onnx/onnx_model.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/base64.h"
#include "doppel/core/tensor/reference_scope.h"

namespace doppel {
namespace {

using torch::jit::Stack;

std::map<std::string, std::string> key_values(const TriangleMesh& mesh, nlohmann::ordered_json metadata,
                                              const QuantizedWeights& quantized) {
  if (!quantized.all().empty()) metadata["quantized"] = quantized.metadata();
  std::map<std::string, std::string> pairs{{"metadata.json", metadata.dump(1)}};
  for (const auto& [name, bytes] : mesh_files(mesh)) pairs[name] = base64(bytes);
  return pairs;
}

/// One sample for each batch size that onnx_model asks for.
std::vector<Stack> actor_samples(const ActorDescription& description, bool seen) {
  std::vector<Stack> samples;
  for (const int batch : {1, 2}) {
    samples.push_back({random_windows(description, batch, 5)});
    if (seen) samples.back().emplace_back(random_projections(batch, 6));
  }
  return samples;
}

/// The method `complete`: (window, projection) -> vertices, and the looks that there are.
void add_complete(ScriptFileWriter& file, const ActorDescription& description, const ActorFunctions& functions) {
  file.add("complete", actor_samples(description, true).front(), [&](const Stack& inputs) {
    const torch::Tensor window = inputs.at(0).toTensor(), projection = inputs.at(1).toTensor();
    const torch::Tensor vertices = functions.geometry(window);
    Stack results{vertices};
    for (const LookFunction* look : {&functions.texture, &functions.gaussians})
      if (*look) results.emplace_back((*look)(window, projection, vertices));
    return results;
  });
}

}  // namespace

void write_actor_onnx(const std::filesystem::path& path, const Character& character,
                      const ActorDescription& description, const ActorFunctions& functions,
                      const ScriptModules& modules, const QuantizedWeights& quantized) {
  const ReferenceScope plain_operations;
  const bool seen = functions.texture || functions.gaussians;  // by a camera
  ScriptFileWriter traced = traced_actor(description, functions, modules);
  OnnxSignature signature{{"window"}, {"vertices"}};
  if (seen) {
    add_complete(traced, description, functions);
    signature.inputs.emplace_back("projection");
  }
  if (functions.texture) signature.outputs.emplace_back("texture");
  if (functions.gaussians) signature.outputs.emplace_back("gaussians");
  write_atomically(
      path, onnx_model(traced.module(), seen ? "complete" : "forward", signature, actor_samples(description, seen),
                       key_values(character.mesh, actor_metadata(character, description), quantized), &quantized));
}

void write_pose_onnx(const std::filesystem::path& path, TrainedPose& trained, const QuantizedWeights& quantized) {
  const ReferenceScope plain_operations;
  const TracedPose traced = traced_pose(trained);
  std::vector<Stack> samples;
  for (const int batch : {1, 2}) {
    const Stack inputs = sample_of_placed(traced.description, batch);
    samples.push_back({inputs[0], inputs[2]});
  }
  write_atomically(
      path, onnx_model(traced.file.module(), "forward", {{"image", "rotation"}, {"dofs", "landmarks", "vertices"}},
                       samples, key_values(trained.character.mesh, traced.metadata, quantized), &quantized));
}

}  // namespace doppel
