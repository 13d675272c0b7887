#pragma once

#include <filesystem>
#include <optional>

#include "doppel/geometry/file_space.h"
#include "doppel/geometry/mesh.h"
#include "doppel/io/figure_export/corrective_function.h"
#include "doppel/io/figure_export/euler_tracks.h"
#include "doppel/io/figure_export/figure_clip.h"
#include "doppel/io/figure_export/glb_compression.h"

namespace doppel {

/// Whose avatar a figure is.
struct FigureRights {
  std::vector<std::string> authors;  ///< empty: the file does not say so
  std::string licence;               ///< address of a licence besides that of VRM; may be empty
};

/// Checks, before frames are computed, that a figure with authors can be an avatar of VRM 1.0.
/// @param name of the figure, for the message
/// @throws UsageError when the figure lacks bones that VRM requires
void check_avatar(const Figure& figure, const std::string& name, const FigureRights& rights);

/// What an exported file says besides the surface.
struct FigureFile {
  std::string name;          ///< of the figure, and of the animation of a clip without parts
  const TriangleMesh& mesh;  ///< rest pose, metres: faces, UVs, colours, texture
  const FigureClip& clip;
  FigureRights rights = {};                  ///< with authors, a .glb is an avatar of VRM 1.0
  std::optional<GlbSteps> compression = {};  ///< a .glb is compressed with these steps; nothing: it is not
  /// A .glb also holds this function, whose weights are those of the second morph target and the following ones
  /// (glb_correctives.h); null: none.
  const CorrectiveFunction* correctives = nullptr;
  /// A .glb also holds this function of the last nodes of the figure; null: none.
  const HelperFunction* helpers = nullptr;
  /// [B] where the nodes of a .glb stand without an animation, node to world; null: in the rest pose.
  const std::vector<Eigen::Affine3d>* standing = nullptr;
};

/// Writes a binary glTF 2.0 file: the skinned mesh with morph targets, the texture as PNG, an animation for each part
/// of the clip. Metres, y up. Names of morph targets are in `extras.targetNames` of the mesh. Vertices are split where
/// the UVs are; the attribute `_VERTEX` says which vertex of the mesh each of them is. With a compression, mesh,
/// figure, targets and tracks are those of compress_figure, and triangles and vertices are reordered. With authors it
/// has the extension VRMC_vrm, for which the figure needs the bone names of VRM (vrm.h), and its nodes rest in a
/// T-pose. Mesh, weights and inverse bind matrices stay those of the figure's rest pose.
/// @throws Error when the file cannot be written, or would be larger than 4 GB; UsageError as vrm_extension
void write_glb(const std::filesystem::path& path, const FigureFile& file, const Figure& figure,
               const MorphTargets& morphs, const FigureTracks& tracks);

/// Writes a binary FBX file of version 7.4: the mesh with UVs and normals, its skin and bind pose, the morph targets as
/// blend shapes, the texture as PNG inside of the file, and the animation. Centimetres (UnitScaleFactor 1), y up. The
/// vertices keep the order of the mesh. Curves are straight between the keys of tracks and turns. The same input gives
/// the same bytes.
/// @param turns the rotations of the tracks (euler_tracks); may be empty without frames
/// @throws Error when the file cannot be written, or would be larger than 4 GB
void write_fbx(const std::filesystem::path& path, const FigureFile& file, const Figure& figure,
               const MorphTargets& morphs, const FigureTracks& tracks, const std::vector<EulerTrack>& turns);

/// Writes OpenUSD text: a mesh with points, normals and extent of each frame, its UVs, and a material with the texture,
/// which is written beside it as `<stem>.png`. Metres, y up.
void write_usda(const std::filesystem::path& path, const FigureFile& file);

/// Writes OpenUSD text with a skeleton (UsdSkel): the rest mesh with normals and linear blend skinning, the animation
/// of the joints, the morph targets as blend shapes by their names, the extent of each frame, and a material with the
/// texture. Every frame has a sample of its own; the values without a time are those of the first. Metres, y up.
/// @param texture name of the image, which is written beside the file
void write_usda_skel(const std::filesystem::path& path, const FigureFile& file, const Figure& figure,
                     const MorphTargets& morphs, const FigureTracks& tracks, const std::string& texture);

/// Writes the positions of all frames as a PC2 point cache (little endian), for the vertices in the order of write_obj.
void write_pc2(const std::filesystem::path& path, const FigureClip& clip, const FileSpace& space = {});

/// Writes the positions of all frames as an MDD point cache (big endian).
void write_mdd(const std::filesystem::path& path, const FigureClip& clip, const FileSpace& space = {});

}  // namespace doppel
