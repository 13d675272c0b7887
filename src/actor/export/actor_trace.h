#pragma once

#include <torch/types.h>

#include <cstdint>
#include <functional>

#include "doppel/actor/export/actor_metadata.h"
#include "doppel/actor/export/script_file.h"

namespace doppel {

/// The function in an actor file: motion window [B,F+1,D], oldest first -> posed vertices [B,N,3], world metres.
using ActorFunction = std::function<torch::Tensor(const torch::Tensor&)>;

/// The look of the actor in a camera: motion window [B,F+1,D], the camera's projection [B,3,4] (pixels from world
/// metres) and the vertices [B,N,3] of `ActorFunctions::geometry` -> a tensor.
using LookFunction = std::function<torch::Tensor(const torch::Tensor&, const torch::Tensor&, const torch::Tensor&)>;

/// A look as the function of a script module, and inputs for it: (window, projection, vertices), random as below.
ScriptFileWriter::Function look_method(const LookFunction& look);
torch::jit::Stack look_inputs(const ActorDescription& description, const ActorFunction& geometry, int batch,
                              std::uint64_t seed);

struct ActorFunctions {
  ActorFunction geometry;
  LookFunction texture = {};    ///< -> RGB texture [B,T,T,3], 0..1, row 0 at v = 1; may be empty
  LookFunction gaussians = {};  ///< -> rows [B,P,14] of Gaussians (splat_rows.h); may be empty
};

/// Random poses around the pose in which all DoFs are 0. @return [batch, F+1, D]
torch::Tensor random_windows(const ActorDescription& description, int batch, std::uint64_t seed);
/// Cameras some metres away that point roughly at the origin. @return [batch,3,4]
torch::Tensor random_projections(int batch, std::uint64_t seed);

/// The largest error of a trace in metres: the accuracy that a host can rely on.
inline constexpr double kTraceTolerance = 1e-5;
/// The largest error of a trace in colours 0..1, a quarter of an 8-bit step: if a vertex of a small face is off by
/// kTraceTolerance, its normal changes the colour by this much.
inline constexpr double kTraceColourTolerance = 1e-3;

/// Rows of Gaussians as they are compared: q and -q are the same rotation, so quaternions become the products of their
/// numbers. Metres are multiplied by 10, so that kTraceColourTolerance allows 0.1 mm. @return [B,P,20]
torch::Tensor comparable_gaussians(const torch::Tensor& rows);

/// The functions of an actor as methods of a script module: `forward(window) -> vertices`; with a texture,
/// `textured(window, projection) -> (vertices, texture)` and `texture(window, projection, vertices) -> texture`; with
/// Gaussians, `gaussians(window, projection, vertices) -> rows`. They are traced on random input of one batch size.
/// Then trace and function are compared on another batch size, which detects sizes that the trace has fixed.
/// @param modules the modules that the functions use
/// @throws Error when a traced function differs from the given function by more than kTraceTolerance (colours:
/// kTraceColourTolerance; Gaussians: as comparable_gaussians says), or contains an operation that is not aten's
ScriptFileWriter traced_actor(const ActorDescription& description, const ActorFunctions& functions,
                              const ScriptModules& modules);

}  // namespace doppel
