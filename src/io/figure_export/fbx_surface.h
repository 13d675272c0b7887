#pragma once

#include "doppel/io/figure_export/fbx_document.h"
#include "doppel/io/figure_export/write_figure.h"

namespace doppel {

/// Adds the rest surface: triangles in the order of the mesh, with UVs, normals, and colours where there is no texture.
/// @return id of the geometry
std::int64_t add_fbx_geometry(FbxDocument& document, const FigureFile& file, const Figure& figure);

/// Adds the material and its texture, whose PNG the file contains. @param image name that the texture has as a file
/// @return id of the material
std::int64_t add_fbx_material(FbxDocument& document, const FigureFile& file, const std::string& image);

/// Adds the morph targets as blend shapes of a geometry. @return [K] ids of their channels
std::vector<std::int64_t> add_fbx_shapes(FbxDocument& document, std::int64_t geometry, const FigureFile& file,
                                         const MorphTargets& morphs);

}  // namespace doppel
