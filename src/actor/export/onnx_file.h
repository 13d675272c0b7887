#pragma once

#include <filesystem>

#include "doppel/actor/export/actor_metadata.h"
#include "doppel/actor/export/actor_trace.h"
#include "doppel/actor/export/quantized_weights.h"
#include "doppel/actor/trained_pose.h"

namespace doppel {

// Both files are ONNX models of opset 17 with a batch of any size. Their key-value pairs are `metadata.json` (as in the
// TorchScript file) and, in base64, the template's `faces.npy` [F,3] int32, `uvs.npy` [U,2] float32 and `face_uvs.npy`
// [F,3] int32. Quantized weights stand in the file under the names of their parameters, and `metadata.json` has the
// field `quantized`.

/// Writes an actor: `window` [B,F+1,D] -> `vertices` [B,N,3] in world metres. With a texture or Gaussians there is a
/// second input `projection` [B,3,4], and there are the outputs `texture` [B,T,T,3] and `gaussians` [B,P,14], as in
/// actor_file.h.
/// @throws Error as traced_actor and onnx_model (actor/onnx/onnx_model.h)
void write_actor_onnx(const std::filesystem::path& path, const Character& character,
                      const ActorDescription& description, const ActorFunctions& functions,
                      const ScriptModules& modules, const QuantizedWeights& quantized = {});

/// Writes PoseNet and, if `trained` has one, DefNet: `image` [B,3,S,S] and `rotation` [B,3,3] -> `dofs` [B,D],
/// `landmarks` [B,M,3] and `vertices` [B,N,3] with the root's pivot at the origin, as the method `forward` of
/// pose_file.h.
void write_pose_onnx(const std::filesystem::path& path, TrainedPose& trained, const QuantizedWeights& quantized = {});

}  // namespace doppel
