#pragma once

#include <torch/types.h>

#include <cstdint>
#include <functional>

#include "doppel/actor/export/actor_metadata.h"
#include "doppel/actor/export/script_file.h"

namespace doppel {

/// The function in an actor file: motion window [B,F+1,D], oldest first -> posed vertices [B,N,3], world metres.
using ActorFunction = std::function<torch::Tensor(const torch::Tensor&)>;

/// The second function, for an actor with a dynamic texture: motion window [B,F+1,D], the camera's projection [B,3,4]
/// (pixels from world metres) and the vertices [B,N,3] that the first function gave -> RGB texture [B,T,T,3], 0..1, row
/// 0 at v = 1.
using TextureFunction = std::function<torch::Tensor(const torch::Tensor&, const torch::Tensor&, const torch::Tensor&)>;

struct ActorFunctions {
  ActorFunction geometry;
  TextureFunction texture;  ///< may be empty
};

/// Random poses around the pose in which all DoFs are 0. @return [batch, F+1, D]
torch::Tensor random_windows(const ActorDescription& description, int batch, std::uint64_t seed);
/// Cameras some metres away that point roughly at the origin. @return [batch,3,4]
torch::Tensor random_projections(int batch, std::uint64_t seed);

/// The functions of an actor as methods of a script module: `forward(window) -> vertices` and, with a texture,
/// `textured(window, projection) -> (vertices, texture)` and `texture(window, projection, vertices) -> texture`. They
/// are traced on random input of one batch size. Then trace and function are compared on another batch size, which
/// detects sizes that the trace has fixed.
/// @param modules the modules that the functions use
/// @throws Error when a traced function differs from the given function by more than 1e-5 m (1e-3 in colours 0..1), or
/// contains an operation that is not aten's
ScriptFileWriter traced_actor(const ActorDescription& description, const ActorFunctions& functions,
                              const ScriptModules& modules);

}  // namespace doppel
