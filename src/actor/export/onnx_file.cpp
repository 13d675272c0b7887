#include "doppel/actor/export/onnx_file.h"

#include "doppel/actor/export/pose_trace.h"
#include "doppel/actor/onnx/onnx_model.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/base64.h"
#include "doppel/core/tensor/reference_scope.h"

namespace doppel {
namespace {

using torch::jit::Stack;

std::map<std::string, std::string> key_values(const TriangleMesh& mesh, const nlohmann::ordered_json& metadata) {
  std::map<std::string, std::string> pairs{{"metadata.json", metadata.dump(1)}};
  for (const auto& [name, bytes] : mesh_files(mesh)) pairs[name] = base64(bytes);
  return pairs;
}

/// One sample for each batch size that onnx_model asks for.
std::vector<Stack> actor_samples(const ActorDescription& description, bool textured) {
  std::vector<Stack> samples;
  for (const int batch : {1, 2}) {
    samples.push_back({random_windows(description, batch, 5)});
    if (textured) samples.back().emplace_back(random_projections(batch, 6));
  }
  return samples;
}

}  // namespace

void write_actor_onnx(const std::filesystem::path& path, const Character& character,
                      const ActorDescription& description, const ActorFunctions& functions,
                      const ScriptModules& modules) {
  const ReferenceScope plain_operations;
  const bool textured = functions.texture != nullptr;
  const ScriptFileWriter traced = traced_actor(description, functions, modules);
  const OnnxSignature signature = textured ? OnnxSignature{{"window", "projection"}, {"vertices", "texture"}}
                                           : OnnxSignature{{"window"}, {"vertices"}};
  write_atomically(path, onnx_model(traced.module(), textured ? "textured" : "forward", signature,
                                    actor_samples(description, textured),
                                    key_values(character.mesh, actor_metadata(character, description))));
}

void write_pose_onnx(const std::filesystem::path& path, TrainedPose& trained) {
  const ReferenceScope plain_operations;
  const TracedPose traced = traced_pose(trained);
  std::vector<Stack> samples;
  for (const int batch : {1, 2}) {
    const Stack inputs = sample_of_placed(traced.description, batch);
    samples.push_back({inputs[0], inputs[2]});
  }
  write_atomically(
      path, onnx_model(traced.file.module(), "forward", {{"image", "rotation"}, {"dofs", "landmarks", "vertices"}},
                       samples, key_values(trained.character.mesh, traced.metadata)));
}

}  // namespace doppel
