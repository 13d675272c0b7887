#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "doppel/actor/export/animation.h"
#include "doppel/actor/export/camera_path.h"
#include "doppel/render/splats/splats.h"

namespace doppel {

/// The Gaussians of an actor at the end of a motion window [1,F+1,D], whose surface has the vertices [1,N,3], as the
/// camera `projection` [1,3,4] sees them.
using SplatFunction =
    std::function<Splats(const torch::Tensor& window, const torch::Tensor& projection, const torch::Tensor& vertices)>;

/// Files of Gaussians, one for each frame.
struct SplatFormats {
  bool ply = false;  ///< `splats_000000.ply`, ... (write_splat_ply)
  bool glb = false;  ///< `splats_000000.glb`, ... (write_splat_glb)
};
/// @param path the cameras that look at the actor
std::unique_ptr<SequenceWriter> make_splat_writer(const std::filesystem::path& folder, SplatFunction splats,
                                                  std::unique_ptr<CameraPath> path, const SplatFormats& formats);

}  // namespace doppel
