#pragma once

#include <filesystem>

#include "doppel/figure_export/figure_clip.h"
#include "doppel/geometry/mesh.h"

namespace doppel {

/// What an exported file says besides the surface.
struct FigureFile {
  std::string name;          ///< of the figure and its animation
  const TriangleMesh& mesh;  ///< rest pose, metres: faces, UVs, colours, texture
  const FigureClip& clip;
};

/// Writes a binary glTF 2.0 file: the skinned mesh with morph targets, the texture as PNG, the animation. Metres, y up.
/// Vertices are split where the UVs are; the attribute `_VERTEX` says which vertex of the mesh each of them is.
/// @throws Error when the file cannot be written, or would be larger than 4 GB
void write_glb(const std::filesystem::path& path, const FigureFile& file, const Figure& figure,
               const MorphTargets& morphs, const FigureTracks& tracks);

/// Writes OpenUSD text: a mesh with one set of points per frame, its UVs, and a material with the texture, which is
/// written beside it as `<stem>.png`. Metres, y up.
void write_usda(const std::filesystem::path& path, const FigureFile& file);

/// Writes the positions of all frames as a PC2 point cache (little endian), for the vertices in the order of write_obj.
void write_pc2(const std::filesystem::path& path, const FigureClip& clip);

/// Writes the positions of all frames as an MDD point cache (big endian).
void write_mdd(const std::filesystem::path& path, const FigureClip& clip);

}  // namespace doppel
