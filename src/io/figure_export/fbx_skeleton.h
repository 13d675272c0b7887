#pragma once

#include "doppel/io/figure_export/fbx_document.h"
#include "doppel/io/figure_export/figure.h"

namespace doppel {

/// Adds the bones as models below the scene. Each holds its rest rotation as `PreRotation`, so that `Lcl Rotation` is 0
/// in the rest pose. @return [B] ids
std::vector<std::int64_t> add_fbx_bones(FbxDocument& document, const Figure& figure);

/// Adds the skinning weights of a geometry, whose model stands at the origin: a cluster for each bone with weights.
void add_fbx_skin(FbxDocument& document, const Figure& figure, const std::string& name,
                  const std::vector<std::int64_t>& bones, std::int64_t geometry);

/// Adds the pose in which surface and bones are bound. @param surface model of the surface
void add_fbx_bind_pose(FbxDocument& document, const Figure& figure, const std::string& name,
                       const std::vector<std::int64_t>& bones, std::int64_t surface);

}  // namespace doppel
