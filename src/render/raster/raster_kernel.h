#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"
#include "doppel/render/raster/raster_view.h"

namespace doppel::kernels {

/// Corners are rounded to 1 / 2^kSubpixelBits pixel.
constexpr int kSubpixelBits = 8;
constexpr int kSubpixels = 1 << kSubpixelBits;
/// A tile is one 64-bit word of coverage wide.
constexpr int kTile = 64;
/// Rows of a tile buffer are one vector longer than the tile, so that the last vector of a row may overhang.
constexpr int kTileStride = kTile + 16;
/// Faces with a vertex whose pixel lies outside [kGuardMin, kGuardMax] are cut like those behind the near plane. This
/// keeps the edge functions of a tile within 32 bits for images up to kMaxImage.
constexpr float kGuardMin = -8192, kGuardMax = 24576;
constexpr int kMaxImage = 16384;

/// Tiles that the bounding box of a face overlaps; x0 = -1: the face must be cut first.
struct FaceTiles {
  std::int32_t face;
  std::int16_t x0, y0, x1, y1;
};

/// A triangle that remains after a face was cut; `inverse depth = iz + izx * u + izy * v` of the whole face.
struct CutTriangle {
  std::int32_t x[3], y[3];  ///< in parts of a pixel
  double iz, izx, izy;
  float iz_min, iz_max;
  std::int32_t face;
};

/// Part of a tile, pixels, end exclusive; empty when x1 <= x0.
struct TileRect {
  std::int16_t x0 = kTile, y0 = kTile, x1 = 0, y1 = 0;
};

/// Inverse depth and face of each pixel of a tile during drawing. `inverse_depth` starts at 0, `face` at -1.
struct TileBuffer {
  alignas(64) float inverse_depth[kTile * kTileStride];
  alignas(64) std::int32_t face[kTile * kTileStride];
};

/// Faces to draw into the tile that starts at pixel (x0, y0): an index, or ~i for cut[i].
struct TileWork {
  const std::int32_t* entries;
  std::int64_t count;
  const CutTriangle* cut;
  int x0, y0;
};

/// Output images of a view. Null images are not written.
struct RasterOutput {
  std::int32_t* face_id = nullptr;
  float* depth = nullptr;
  float* barycentrics = nullptr;
};

DOPPEL_DECLARE_KERNEL(void, project_vertices, (const RasterView& view, std::int64_t begin, std::int64_t end))
/// Writes the faces of [begin, end) that can cover a pixel, ascending. `out` has room for all. @return their number
DOPPEL_DECLARE_KERNEL(std::int64_t, bound_faces,
                      (const RasterView& view, std::int64_t begin, std::int64_t end, FaceTiles* out))
DOPPEL_DECLARE_KERNEL(void, draw_tile,
                      (const RasterView& view, const TileWork& work, TileBuffer& tile, TileRect& touched))
/// `rows` [64], bit x of rows[y] is pixel (x0 + x, y0 + y).
DOPPEL_DECLARE_KERNEL(void, cover_tile, (const RasterView& view, const TileWork& work, std::uint64_t* rows))
/// Writes `rect` of the tile to the images and resets it in the buffer.
DOPPEL_DECLARE_KERNEL(void, resolve_tile,
                      (const RasterView& view, int x0, int y0, TileRect rect, TileBuffer& tile,
                       const RasterOutput& out))

/// Perspective-correct barycentrics of pixels of a view. @param faces, x, y [count] @param out [count,3]
DOPPEL_DECLARE_KERNEL(void, pixel_barycentrics,
                      (const RasterView& view, const std::int32_t* faces, const std::int32_t* x, const std::int32_t* y,
                       std::int64_t count, float* out))

/// The columns in [begin,end) of covered pixels with an uncovered neighbour (of four).
/// @param row faces of the row, -1: uncovered; `stride` pixels from its neighbours; up to kTileStride - kTile columns
/// beyond `end` are read @param columns room for end - begin @return their number
DOPPEL_DECLARE_KERNEL(std::int64_t, outline_columns,
                      (const std::int32_t* row, std::int64_t stride, int begin, int end, std::int32_t* columns))

}  // namespace doppel::kernels
