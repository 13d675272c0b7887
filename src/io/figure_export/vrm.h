#pragma once

#include <tiny_gltf.h>

#include "doppel/io/figure_export/write_figure.h"

namespace doppel {

/// The glTF extension VRMC_vrm (VRM 1.0) of a figure whose bones have the names of VRM (BoneNames::vrm): which node is
/// which bone of a human, and whose avatar it is. All permissions are the strictest ones of VRM.
/// @param first_node node of the file that is bone 0 of the figure
/// @throws UsageError without an author, and when the figure lacks bones that VRM requires
tinygltf::Value vrm_extension(const Figure& figure, const std::string& name, const FigureRights& rights,
                              int first_node);

}  // namespace doppel
