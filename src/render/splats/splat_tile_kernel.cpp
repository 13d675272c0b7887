#include "doppel/render/splats/splat_kernel.h"
#include "doppel/render/splats/splat_lanes.h"

namespace doppel::kernels::DOPPEL_ISA {
namespace {

constexpr float kThreshold = static_cast<float>(-kLog2Of255);
constexpr float kMaxAlpha = static_cast<float>(kMaxSplatAlpha), kMinThrough = static_cast<float>(kMinTransmittance);
constexpr int kStride = SplatScratch::kStride;

inline Float8 lane_numbers8() { return Float8{0, 1, 2, 3, 4, 5, 6, 7}; }

// --- runs of eight pixels --------------------------------------------------------------------------------------------

/// Eight rows of a Gaussian in a tile: the first pixel where the exponent may reach the threshold, and the run from
/// there on.
struct Rows {
  Int8 first;
  Float8 along, half;  ///< the exponent reaches the threshold where |a dx + along| <= half
  Float8 s, exponent, r;
};

inline Rows find_rows(const SplatRecord& g, float shift, float width, float y) {
  Rows rows;
  const Float8 dy = lane_numbers8() + y;
  rows.along = g.b * dy;
  rows.r = g.c * dy;
  rows.exponent = g.log_opacity - rows.r * rows.r;
  rows.half = sqrt8(max8(rows.exponent - kThreshold, Float8{}));
  const Float8 left = (-rows.along - rows.half) * g.inverse_a - shift;
  // A margin of .01 keeps pixels that rounding would drop.
  rows.first = __builtin_convertvector(min8(max8(left, eight(-0.99f)) + 0.99f, eight(width)), Int8);
  rows.s = g.a * (__builtin_convertvector(rows.first, Float8) + shift) + rows.along;
  return rows;
}

/// The number of runs of each row.
inline Int8 count_runs(const Rows& rows, const SplatRecord& g, float shift, float width) {
  const Float8 right = (rows.half - rows.along) * g.inverse_a - shift;
  const Int8 end = __builtin_convertvector(min8(max8(right, eight(-1.0f)) + 1.01f, eight(width)), Int8);
  return (end - rows.first + (kEight - 1)) >> 3;
}

/// For each set of lanes, given by its bits: their numbers in ascending order, then 0.
struct LaneLists {
  alignas(32) std::int32_t lanes[256][kEight];
  constexpr LaneLists() : lanes{} {
    for (int bits = 0; bits < 256; ++bits) {
      int n = 0;
      for (int lane = 0; lane < kEight; ++lane) {
        if (bits >> lane & 1) lanes[bits][n++] = lane;
      }
    }
  }
};
constexpr LaneLists kLaneLists;

/// Stores the lanes of `bits` one after the other. Writes eight.
template <typename V, typename T>
inline void store_lanes(T* out, V v, Int8 lanes) {
  const V packed = lanes8(v, lanes);
  std::memcpy(out, &packed, sizeof packed);
}

/// Adds the runs of a Gaussian behind the first n. Each row has one at least, be it of transparent pixels.
/// @param position in the order @return the number of runs
inline int find_runs(const SplatTile& tile, std::int64_t position, SplatScratch& out, int n) {
  constexpr std::int64_t kAhead = 8;  // records lie anywhere in memory
  __builtin_prefetch(tile.splats + tile.order[position + kAhead < tile.count ? position + kAhead : position]);
  const std::int32_t number = tile.order[position];
  const SplatRecord& g = tile.splats[number];
  const int top = (g.y0 > tile.y0 ? g.y0 : tile.y0) - tile.y0;
  const int bottom = (g.y1 < tile.y1 - 1 ? g.y1 : tile.y1 - 1) - tile.y0;
  // The most runs of a row, from integers. If the loop below ended when no row has more, the processor would know its
  // end only after the square roots, and would often predict it wrongly.
  const int left = g.x0 > tile.x0 ? g.x0 : tile.x0, right = g.x1 < tile.x1 - 1 ? g.x1 : tile.x1 - 1;
  const int columns = (right - left + kEight) >> 3;
  // Pixel x of the tile has dx = x + shift.
  const float shift = static_cast<float>(tile.x0 - g.pixel_x) + (0.5f - g.x);
  const float from_centre = static_cast<float>(tile.y0 - g.pixel_y) + (0.5f - g.y);
  const auto width = static_cast<float>(tile.x1 - tile.x0);
  const Int8 splat = number - Int8{}, numbers{0, 1, 2, 3, 4, 5, 6, 7};
  const float step = kEight * g.a;
  for (int row = top; row <= bottom; row += kEight) {
    Rows rows = find_rows(g, shift, width, static_cast<float>(row) + from_centre);
    const int here = bottom - row + 1 < kEight ? bottom - row + 1 : kEight;
    Int8 at = rows.first + (row * kStride + kStride * numbers);
    std::memcpy(out.splat + n, &splat, sizeof splat);
    std::memcpy(out.at + n, &at, sizeof at);
    store8(out.s + n, rows.s);
    store8(out.exponent + n, rows.exponent);
    store8(out.r + n, rows.r);
    n += here;
    if (columns <= 1) continue;
    const Int8 count = count_runs(rows, g, shift, width) & (numbers < here);
    for (int k = 1; k < columns; ++k) {
      const unsigned bits = bits8(count > k);
      at += kEight;
      rows.s += step;
      Int8 lanes;
      std::memcpy(&lanes, kLaneLists.lanes[bits], sizeof lanes);
      std::memcpy(out.splat + n, &splat, sizeof splat);
      store_lanes(out.at + n, at, lanes);
      store_lanes(out.s + n, rows.s, lanes);
      store_lanes(out.exponent + n, rows.exponent, lanes);
      store_lanes(out.r + n, rows.r, lanes);
      n += __builtin_popcount(bits);
    }
  }
  return n;
}

/// a dx + b dy of the pixels of a run. Forward and backward must round alike.
inline Float8 run_offsets(float a, float s) { return a * lane_numbers8() + s; }

/// Alpha of eight pixels, 0 below the threshold. @param s a dx + b dy
inline Float8 alpha_of(float exponent, Float8 s) {
  const Float8 e = exponent - s * s;
  return min8(where8(e >= kThreshold, exp2_8(e)), eight(kMaxAlpha));
}

inline void fill(float* plane, float value) {
  for (int i = 0; i < kSplatTileHeight * kStride; ++i) plane[i] = value;
}

// --- forward ---------------------------------------------------------------------------------------------------------

/// Adds runs to the planes: transmittance, red, green, blue, depth.
template <bool kDepth>
inline void blend(const SplatRecord* splats, int count, SplatScratch& scratch) {
  auto& planes = scratch.planes;
  const auto alpha_of_run = [&](int i) {
    return alpha_of(scratch.exponent[i], run_offsets(splats[scratch.splat[i]].a, scratch.s[i]));
  };
  // The alpha of the next run beside the blending of this one: the processor waits less.
  scratch.splat[count] = 0;
  Float8 next = alpha_of_run(0);
  for (int i = 0; i < count; ++i) {
    const SplatRecord& g = splats[scratch.splat[i]];
    const std::int32_t at = scratch.at[i];
    const Float8 alpha = next;
    next = alpha_of_run(i + 1);
    const Float8 through = load8(planes[0] + at);
    const Float8 weight = where8(through >= kMinThrough, alpha * through);
    store8(planes[0] + at, through - weight);
    for (int c = 0; c < 3; ++c) store8(planes[1 + c] + at, load8(planes[1 + c] + at) + weight * g.colour[c]);
    if (kDepth) store8(planes[4] + at, load8(planes[4] + at) + weight * g.depth);
  }
}

template <bool kDepth>
void draw(const SplatTile& tile, SplatScratch& scratch) {
  fill(scratch.planes[0], 1.0f);
  for (int k = 1; k < (kDepth ? 5 : 4); ++k) fill(scratch.planes[k], 0.0f);
  int count = 0;
  for (std::int64_t i = 0; i < tile.count; ++i) {
    count = find_runs(tile, i, scratch, count);
    if (count < SplatScratch::kRunsAtOnce) continue;
    blend<kDepth>(tile.splats, count, scratch);
    count = 0;
  }
  blend<kDepth>(tile.splats, count, scratch);
}

void clear(const SplatTile& tile, const SplatPlanes& image) {
  const auto columns = static_cast<std::size_t>(tile.x1 - tile.x0);
  for (int y = tile.y0; y < tile.y1; ++y) {
    const std::int64_t out = y * tile.width + tile.x0;
    std::memset(image.colour + 3 * out, 0, 3 * columns * sizeof(float));
    std::memset(image.alpha + out, 0, columns * sizeof(float));
    if (image.depth) std::memset(image.depth + out, 0, columns * sizeof(float));
  }
}

}  // namespace

void draw_splat_tile(const SplatTile& tile, const SplatPlanes& image, SplatScratch& scratch) {
  if (tile.count == 0) return clear(tile, image);
  if (image.depth) {
    draw<true>(tile, scratch);
  } else {
    draw<false>(tile, scratch);
  }
  auto& planes = scratch.planes;
  for (int y = tile.y0; y < tile.y1; ++y) {
    const int row = (y - tile.y0) * kStride;
    const std::int64_t out = y * tile.width + tile.x0;
    for (int x = 0; x < tile.x1 - tile.x0; ++x) {
      for (int c = 0; c < 3; ++c) image.colour[3 * (out + x) + c] = planes[1 + c][row + x];
      image.alpha[out + x] = 1.0f - planes[0][row + x];
      if (image.depth) image.depth[out + x] = planes[4][row + x];
    }
  }
}

// --- backward --------------------------------------------------------------------------------------------------------

namespace {

/// Planes of the backward pass: transmittance; the weighted gradient of all Gaussians that are not blended yet; the
/// gradients to colour, alpha and depth.
enum Plane { kThrough, kRest, kRed, kGreen, kBlue, kAlpha, kDepthPlane };

void load_upstream(const SplatTile& tile, const ConstSplatPlanes& image, const ConstSplatPlanes& upstream,
                   SplatScratch& scratch) {
  auto& planes = scratch.planes;
  fill(planes[kThrough], 1.0f);
  for (int k = kRest; k <= kDepthPlane; ++k) fill(planes[k], 0.0f);
  for (int y = tile.y0; y < tile.y1; ++y) {
    const int row = (y - tile.y0) * kStride;
    const std::int64_t in = y * tile.width + tile.x0;
    for (int x = 0; x < tile.x1 - tile.x0; ++x) {
      float rest = 0.0f;
      for (int c = 0; c < 3; ++c) {
        const float g = upstream.colour[3 * (in + x) + c];
        planes[kRed + c][row + x] = g;
        rest += g * image.colour[3 * (in + x) + c];
      }
      if (upstream.alpha) {
        planes[kAlpha][row + x] = upstream.alpha[in + x];
        rest += upstream.alpha[in + x] * image.alpha[in + x];
      }
      if (upstream.depth) {
        planes[kDepthPlane][row + x] = upstream.depth[in + x];
        rest += upstream.depth[in + x] * image.depth[in + x];
      }
      planes[kRest][row + x] = rest;
    }
  }
}

/// Sums of a Gaussian over the pixels of its runs.
template <bool kDepth>
inline void gather(const SplatRecord& g, int begin, int end, SplatScratch& scratch, SplatSums& out) {
  auto& planes = scratch.planes;
  Float8 sum_g{}, sum_gs{}, sum_gr{}, sum_gss{}, sum_gsr{}, sum_grr{}, sum_colour[3]{}, sum_depth{};
  for (int i = begin; i < end; ++i) {
    const std::int32_t at = scratch.at[i];
    const float r = scratch.r[i];
    const Float8 s = run_offsets(g.a, scratch.s[i]), alpha = alpha_of(scratch.exponent[i], s);
    const Float8 through = load8(planes[kThrough] + at);
    const Int8 open = through >= kMinThrough;
    const Float8 weight = where8(open, alpha * through);
    store8(planes[kThrough] + at, through - weight);
    Float8 value = load8(planes[kAlpha] + at);
    for (int c = 0; c < 3; ++c) {
      const Float8 upstream = load8(planes[kRed + c] + at);
      value += g.colour[c] * upstream;
      sum_colour[c] += weight * upstream;
    }
    if (kDepth) {
      const Float8 upstream = load8(planes[kDepthPlane] + at);
      value += g.depth * upstream;
      sum_depth += weight * upstream;
    }
    const Float8 rest = load8(planes[kRest] + at) - weight * value;
    store8(planes[kRest] + at, rest);
    const Float8 to_alpha = through * value - rest / (1.0f - alpha);
    const Float8 to_exponent = where8(open & (alpha < kMaxAlpha), to_alpha * alpha), along = to_exponent * s;
    sum_g += to_exponent;
    sum_gs += along;
    sum_gr += to_exponent * r;
    sum_gss += along * s;
    sum_gsr += along * r;
    sum_grr += to_exponent * (r * r);
  }
  const Float8 low = sums8(sum_g, sum_gs, sum_gr, sum_gss, sum_gsr, sum_grr, sum_colour[0], sum_colour[1]);
  std::memcpy(&out, &low, sizeof low);
  out.colour[2] = sum8(sum_colour[2]);
  out.depth = kDepth ? sum8(sum_depth) : 0.0f;
}

}  // namespace

void draw_splat_tile_backward(const SplatTile& tile, const ConstSplatPlanes& image, const ConstSplatPlanes& upstream,
                              SplatScratch& scratch, SplatSums* sums) {
  if (tile.count == 0) return;
  load_upstream(tile, image, upstream, scratch);
  constexpr int kSplatsAtOnce = 64;
  int end[kSplatsAtOnce];
  for (std::int64_t begin = 0; begin < tile.count;) {
    // The runs of several Gaussians first, so that the processor knows early how many each one has.
    int count = 0, splats = 0;
    for (; splats < kSplatsAtOnce && begin + splats < tile.count && count < SplatScratch::kRunsAtOnce; ++splats) {
      count = find_runs(tile, begin + splats, scratch, count);
      end[splats] = count;
    }
    for (int i = 0, run = 0; i < splats; run = end[i++]) {
      const SplatRecord& g = tile.splats[tile.order[begin + i]];
      if (upstream.depth) {
        gather<true>(g, run, end[i], scratch, sums[begin + i]);
      } else {
        gather<false>(g, run, end[i], scratch, sums[begin + i]);
      }
    }
    begin += splats;
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
