#pragma once

#include <filesystem>
#include <memory>

#include "doppel/actor/export/animation.h"
#include "doppel/actor/export/camera_path.h"

namespace doppel {

/// Writes the dynamic texture of each frame, as a camera sees it: `folder/texture_000000.png`, ... The UVs are those of
/// the template.
/// @param path the cameras that look at the actor
std::unique_ptr<SequenceWriter> make_texture_writer(const std::filesystem::path& folder, LookFunction texture,
                                                    std::unique_ptr<CameraPath> path);

}  // namespace doppel
