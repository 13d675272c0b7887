#pragma once

#include <tiny_gltf.h>

#include "doppel/io/figure_export/write_figure.h"

namespace doppel {

/// The T-pose of a figure, for the rest transforms of its nodes: node to world [B], metres. The figure looks along z,
/// as at rest it stands on the lowest foot, arms point to the sides, legs straight down, and the rest of the body is as
/// in the figure's rest pose. A bone turns by the smallest rotation after that of the bone above it.
/// @pre check_avatar
std::vector<Eigen::Affine3d> t_pose(const Figure& figure);

/// The glTF extension VRMC_vrm (VRM 1.0) of a figure whose bones have the names of VRM (BoneNames::vrm): which node is
/// which bone of a human, and whose avatar it is. All permissions are the strictest ones of VRM.
/// @param first_node node of the file that is bone 0 of the figure
/// @throws UsageError without an author, and when the figure lacks bones that VRM requires
tinygltf::Value vrm_extension(const Figure& figure, const std::string& name, const FigureRights& rights,
                              int first_node);

}  // namespace doppel
