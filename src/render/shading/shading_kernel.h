#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"
#include "doppel/render/raster/raster_kernel.h"

namespace doppel::kernels {

/// One view for the shading kernels. A null pointer omits its part.
struct ShadeView {
  const RasterView* raster = nullptr;  ///< backward reads only `vertices` and `faces`
  const float* normals = nullptr;      ///< [N,4] sums of the face normals at a vertex; null: unlit
  const float* lighting = nullptr;     ///< [3,9]
  const float* texture = nullptr;      ///< [texture_height, texture_width, 3], at least 2 x 2; null: white
  const float* uvs = nullptr;          ///< [F,8]
  int texture_width = 0, texture_height = 0;
  int nearest = 0, flip = 0;
  float ray[9] = {};     ///< direction of the ray through pixel (u, v, 1), away from the camera
  float centre[3] = {};  ///< camera centre, world
};

/// Gradient of one face of a tile: first sums over its pixels, then the gradient to its corners.
struct FaceGradient {
  std::int32_t face;
  std::int32_t corner[3];
  /// Per corner k: sums of b_k * (gradient to the barycentrics, tangential), 0, b_k * (gradient to the normal), 0. At
  /// the end: the gradient to the position, 0, the gradient to the normal sum, 0.
  alignas(32) float sum[3][8];
};

/// Gradient of one pixel to four texels: `gradient` weighted by the fractions.
struct TexelGradient {
  std::int32_t texel;  ///< y * width + x of the upper left one
  float fx, fy;
  float gradient[3];
};

/// Outputs of a tile's backward pass. Null parts are not computed.
struct TileGradient {
  FaceGradient* faces = nullptr;         ///< room for kTile * kTile
  std::int32_t* slot_of_face = nullptr;  ///< [F] scratch, any content within [0, kTile * kTile)
  TexelGradient* texels = nullptr;       ///< room for kTile * kTile
  double* lighting = nullptr;            ///< [27], overwritten
  std::int32_t num_faces = 0, num_texels = 0;
};

/// The number of words of memory for the fragments of one tile.
DOPPEL_DECLARE_KERNEL(std::int64_t, fragment_words, ())

/// The images of a tile, from its first pixel. A null image is not written.
struct TileImage {
  float* colour = nullptr;       ///< [rows,stride,3]
  std::uint8_t* mask = nullptr;  ///< [rows,stride], 0 or 1
  std::int64_t stride = 0;       ///< pixels from a row to the next
};

/// Resolves, shades and resets `rect` of the tile at (x0, y0) and writes 0 to the rest of it.
/// @param fragments null or fragment_words() @return number of fragment records
DOPPEL_DECLARE_KERNEL(std::int32_t, shade_tile,
                      (const ShadeView& view, int x0, int y0, TileRect rect, TileBuffer& tile, const TileImage& image,
                       std::int32_t* fragments))

/// The cells of a supersampled tile: cell (i, j) is pixel (x0 / factor + i, y0 / factor + j) of the averaged image.
/// Pixels at the edge of a tile have cells in several tiles.
struct TileCells {
  int factor;
  int columns;   ///< cells of a row
  float* cells;  ///< [rows,columns,4] sums over the samples in `rect`: colour, covered samples; zero on entry
};
/// Adds the samples of `rect` to the cells of the tile at (x0, y0).
DOPPEL_DECLARE_KERNEL(void, sum_samples, (const TileImage& image, int x0, int y0, TileRect rect, const TileCells& out))

/// @param upstream [H,W,3], gradient to the colours
DOPPEL_DECLARE_KERNEL(void, shade_tile_backward,
                      (const ShadeView& view, const float* upstream, int x0, int y0, const std::int32_t* fragments,
                       std::int32_t count, TileGradient& out))

/// Derivative filter of the target: `gradient = sum weight * target[offset]`.
struct TargetView {
  const RasterView* raster = nullptr;
  const float* target = nullptr;  ///< [H,W,3]
  int radius = 1;
};

/// Gradient of a surface point's target value to the corners of its face, as shade_tile_backward writes it.
DOPPEL_DECLARE_KERNEL(void, target_tile_backward,
                      (const TargetView& view, const float* upstream, int x0, int y0, const std::int32_t* fragments,
                       std::int32_t count, TileGradient& out))

// --- normals -------------------------------------------------------------------------------------------------------
/// The mesh for these kernels: vertices [N,3], faces [F,4], the faces at each vertex.
struct NormalMesh {
  const float* vertices;
  const std::int32_t* faces;
  const std::int32_t* offsets;
  const std::int32_t* incident;
};
/// Cross products of the faces [begin,end) -> [F,4]
DOPPEL_DECLARE_KERNEL(void, face_normals,
                      (const NormalMesh& mesh, std::int64_t begin, std::int64_t end, float* normals))
/// Their sums at the vertices [begin,end) -> [N,4]
DOPPEL_DECLARE_KERNEL(void, sum_normals,
                      (const NormalMesh& mesh, const float* face_normals, std::int64_t begin, std::int64_t end,
                       float* normals))

/// Adds the gradients of a tile to the vertices of [begin,end), sums [N,8].
DOPPEL_DECLARE_KERNEL(void, add_face_gradients,
                      (const FaceGradient* faces, std::int64_t count, std::int64_t begin, std::int64_t end,
                       float* sums))
/// Gradient to the face normals from that to the normal sums (`sums` [N,8]) -> [F,4]
DOPPEL_DECLARE_KERNEL(void, face_normal_gradients,
                      (const NormalMesh& mesh, const float* sums, std::int64_t begin, std::int64_t end, float* out))
/// Gradient to the vertices: the position part of `sums` plus the gradient through the normals of their faces (may be
/// null).
DOPPEL_DECLARE_KERNEL(void, vertex_gradients,
                      (const NormalMesh& mesh, const float* sums, const float* face_gradients, std::int64_t begin,
                       std::int64_t end, float* out))

/// Adds the gradients that fall into texel rows [begin,end).
DOPPEL_DECLARE_KERNEL(void, add_texel_gradients,
                      (const TexelGradient* texels, std::int64_t count, int width, int begin, int end, float* texture))

}  // namespace doppel::kernels
