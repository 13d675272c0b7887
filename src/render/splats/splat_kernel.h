#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::kernels {

constexpr int kSplatTileWidth = 64, kSplatTileHeight = 64;
constexpr int kMaxHarmonics = 16;

// The numbers of the definition (splats.h), for kernel and reference.
constexpr double kSplatBlur = 0.3;  ///< square pixels, added to both axes
constexpr double kMinSplatAlpha = 1.0 / 255;
constexpr double kLog2Of255 = 7.994353436858858;
constexpr double kMaxSplatAlpha = 0.99;
constexpr double kMinTransmittance = 1e-4;
constexpr double kOutsideImage = 0.15;                           ///< of the image: J stays constant beyond
constexpr double kMinQuaternion = 1e-12, kMaxQuaternion = 1e12;  ///< lengths
constexpr double kMaxSplatPixel = 1048576;                       ///< no centre beyond is drawn

/// The camera of one view.
struct SplatCamera {
  double matrix[12];  ///< [3,4] pixels from world metres, scaled so that the last row gives metres
  float centre[3];    ///< world
  int width, height;
  float z_near;
  int harmonics;  ///< S
};

/// N Gaussians, as in `Splats`, of one batch item.
struct SplatArrays {
  const float *positions, *rotations, *log_scales, *opacities, *harmonics;
  const float* normals;  ///< null: none
};
/// Gradients are added to these.
struct SplatGradients {
  float *positions, *rotations, *log_scales, *opacities, *harmonics;
};

/// A Gaussian on the screen. Its exponent at the pixel offset (dx, dy) from the centre is, in powers of two,
/// log_opacity - (a dx + b dy)^2 - (c dy)^2.
struct SplatRecord {
  std::int32_t pixel_x, pixel_y;  ///< the pixel of the centre
  float x, y;                     ///< the centre within it, 0 to 1
  float a, b, c, log_opacity;
  float colour[3], depth;
  std::int16_t x0, x1, y0, y1;  ///< pixels where alpha may reach 1/255, both ends included
  std::uint32_t key;            ///< ascending with the distance from the camera; kHiddenSplat: not in the image
  float inverse_a;
};
static_assert(sizeof(SplatRecord) == 64, "one cache line");

constexpr std::uint32_t kHiddenSplat = 0xffffffffu;
/// Records of the Gaussians [begin,end).
DOPPEL_DECLARE_KERNEL(void, project_splats,
                      (const SplatArrays& splats, const SplatCamera& camera, std::int64_t begin, std::int64_t end,
                       SplatRecord* records))

/// The Gaussians of a tile, and its part of the image.
struct SplatTile {
  const SplatRecord* splats;  ///< of the image
  const std::int32_t* order;  ///< [count] those of the tile, nearest first
  std::int64_t count;
  int x0, y0, x1, y1;  ///< pixels of the image; x1, y1 excluded
  std::int64_t width;  ///< of the image
};
/// Whole images [H,W,3], [H,W] and [H,W]; `depth` may be null.
struct SplatPlanes {
  float *colour, *alpha, *depth;
};
struct ConstSplatPlanes {
  const float *colour, *alpha, *depth;
};
/// Memory of one thread; no content is kept between calls.
struct alignas(64) SplatScratch {
  static constexpr int kStride = kSplatTileWidth + 8;  ///< rows end with room for a vector
  static constexpr int kRunsAtOnce = 512, kMaxRuns = kRunsAtOnce + kSplatTileHeight * (kSplatTileWidth / 8) + 8;
  /// The 80 floats between planes keep a pixel of two planes from the same low 12 bits of an address: the processor
  /// would take the load from one plane for a load of what was just stored in the other.
  float planes[8][kSplatTileHeight * kStride + 80];
  /// Runs: up to eight pixels of a row of a Gaussian.
  std::int32_t at[kMaxRuns];     ///< the first pixel in the planes
  std::int32_t splat[kMaxRuns];  ///< its record
  float s[kMaxRuns];             ///< a dx + b dy at the first pixel
  float exponent[kMaxRuns];      ///< log_opacity - r^2
  float r[kMaxRuns];             ///< c dy
};
DOPPEL_DECLARE_KERNEL(void, draw_splat_tile, (const SplatTile& tile, const SplatPlanes& image, SplatScratch& scratch))

/// What a Gaussian gets from one tile. g is the gradient to the natural exponent; s = a dx + b dy, r = c dy.
struct SplatSums {
  float g, gs, gr, gss, gsr, grr;
  float colour[3], depth;
  float unused[6];
};
/// Writes the sums of each Gaussian of the tile.
/// @param image as drawn @param upstream gradient to it; `alpha` and `depth` may be null @param sums [count]
DOPPEL_DECLARE_KERNEL(void, draw_splat_tile_backward,
                      (const SplatTile& tile, const ConstSplatPlanes& image, const ConstSplatPlanes& upstream,
                       SplatScratch& scratch, SplatSums* sums))

/// Where the sums are: those of Gaussian n at slots[first[n]] to slots[first[n+1]], one for each tile that it
/// touches.
struct SplatSlots {
  const std::int32_t *first, *slots;
};
/// Adds the gradients of the Gaussians [begin,end).
DOPPEL_DECLARE_KERNEL(void, project_splats_backward,
                      (const SplatArrays& splats, const SplatCamera& camera, const SplatSlots& at,
                       const SplatSums* sums, std::int64_t begin, std::int64_t end, const SplatGradients& out))

}  // namespace doppel::kernels
