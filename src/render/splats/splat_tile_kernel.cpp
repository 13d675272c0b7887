#include "doppel/render/splats/splat_kernel.h"
#include "doppel/render/splats/splat_lanes.h"

namespace doppel::kernels::DOPPEL_ISA {
namespace {

constexpr float kThreshold = -7.99435344f;  // log2(1/255)
constexpr float kMostAlpha = 0.99f, kLeastTransmittance = 1e-4f;
constexpr int kStride = SplatScratch::kStride;
constexpr int kRunsAtOnce = 1024;

using Run = SplatScratch::Run;

inline Float8 lane_numbers8() { return Float8{0, 1, 2, 3, 4, 5, 6, 7}; }

// --- runs of eight pixels --------------------------------------------------------------------------------------------

/// The rows of a Gaussian in a tile, eight at a time: first and last pixel where the exponent reaches the threshold.
struct Rows {
  alignas(32) std::int32_t first[kEight], count[kEight];  ///< count of runs
  alignas(32) float s[kEight], exponent[kEight], r[kEight];
};

inline void find_rows(const SplatRecord& g, const SplatTile& tile, float y, Rows& rows) {
  const Float8 dy = lane_numbers8() + (y - g.y);
  const Float8 r = g.c * dy, along = g.b * dy, exponent = g.log_opacity - r * r;
  const Float8 room = exponent - kThreshold, half = sqrt8(max8(room, Float8{}));
  // Pixel x of the tile has dx = x + shift. A margin of .01 keeps pixels that rounding would drop.
  const float shift = static_cast<float>(tile.x0 - g.pixel_x) + (0.5f - g.x);
  const Float8 left = (-along - half) * g.inverse_a - shift, right = (half - along) * g.inverse_a - shift;
  const float width = static_cast<float>(tile.x1 - tile.x0);
  const Int8 first = __builtin_convertvector(min8(max8(left, eight(-0.99f)) + 0.99f, eight(width)), Int8);
  const Int8 end = __builtin_convertvector(min8(max8(right, eight(-1.0f)) + 1.01f, eight(width)), Int8);
  const Int8 visible = (room >= 0.0f) & (end > first);
  const Int8 count = visible & ((end - first + (kEight - 1)) >> 3);
  const Float8 s = g.a * (__builtin_convertvector(first, Float8) + shift) + along;
  std::memcpy(rows.first, &first, sizeof first);
  std::memcpy(rows.count, &count, sizeof count);
  store8(rows.s, s);
  store8(rows.exponent, exponent);
  store8(rows.r, r);
}

/// Writes the runs of a Gaussian to `runs`. @return their number
inline int find_runs(const SplatRecord& g, std::int32_t record, const SplatTile& tile, Run* runs) {
  const int top = (g.y0 > tile.y0 ? g.y0 : tile.y0) - tile.y0;
  const int bottom = (g.y1 < tile.y1 - 1 ? g.y1 : tile.y1 - 1) - tile.y0;
  const float from_centre = static_cast<float>(tile.y0 - g.pixel_y) + 0.5f, step = kEight * g.a;
  int n = 0;
  for (int row = top; row <= bottom; row += kEight) {
    Rows rows;
    find_rows(g, tile, static_cast<float>(row) + from_centre, rows);
    const int here = bottom - row + 1 < kEight ? bottom - row + 1 : kEight;
    for (int i = 0; i < here; ++i) {
      std::int32_t at = (row + i) * kStride + rows.first[i];
      float s = rows.s[i];
      runs[n] = {at, record, s, rows.exponent[i], rows.r[i]};
      n += rows.count[i] > 0;
      for (int k = 1; k < rows.count[i]; ++k) {
        at += kEight;
        s += step;
        runs[n++] = {at, record, s, rows.exponent[i], rows.r[i]};
      }
    }
  }
  return n;
}

/// Alpha of the pixels of a run, 0 below the threshold.
inline Float8 alpha_of(const Run& run, Float8 s) {
  const Float8 e = run.exponent - s * s;
  return where8(e >= kThreshold, exp2_8(e));
}

inline void fill(float* plane, float value) {
  for (int i = 0; i < kSplatTileHeight * kStride; ++i) plane[i] = value;
}

// --- forward ---------------------------------------------------------------------------------------------------------

template <bool kDepth>
inline void blend(const SplatRecord* records, const Run* runs, int count, SplatScratch& scratch) {
  auto& planes = scratch.planes;
  for (int i = 0; i < count; ++i) {
    const Run& run = runs[i];
    const SplatRecord& g = records[run.record];
    const Float8 alpha = min8(alpha_of(run, g.a * lane_numbers8() + run.s), eight(kMostAlpha));
    const Float8 through = load8(planes[0] + run.at);
    const Float8 weight = where8(through >= kLeastTransmittance, alpha * through);
    store8(planes[0] + run.at, through - weight);
    for (int c = 0; c < 3; ++c) {
      store8(planes[1 + c] + run.at, load8(planes[1 + c] + run.at) + weight * g.colour[c]);
    }
    if (kDepth) store8(planes[4] + run.at, load8(planes[4] + run.at) + weight * g.depth);
  }
}

template <bool kDepth>
void draw(const SplatTile& tile, SplatScratch& scratch) {
  fill(scratch.planes[0], 1.0f);
  for (int k = 1; k < (kDepth ? 5 : 4); ++k) fill(scratch.planes[k], 0.0f);
  int count = 0;
  for (std::int64_t i = 0; i < tile.count; ++i) {
    const std::int32_t record = tile.pairs[i].record;
    count += find_runs(tile.records[record], record, tile, scratch.runs + count);
    if (count < kRunsAtOnce) continue;
    blend<kDepth>(tile.records, scratch.runs, count, scratch);
    count = 0;
  }
  blend<kDepth>(tile.records, scratch.runs, count, scratch);
}

}  // namespace

void draw_splat_tile(const SplatTile& tile, const SplatPlanes& image, SplatScratch& scratch) {
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
inline void gather(const SplatRecord& g, const Run* runs, int count, SplatScratch& scratch, SplatSums& out) {
  auto& planes = scratch.planes;
  Float8 sum_g{}, sum_gs{}, sum_gr{}, sum_gss{}, sum_gsr{}, sum_grr{}, sum_colour[3]{}, sum_depth{};
  const Float8 lanes = g.a * lane_numbers8();
  for (int i = 0; i < count; ++i) {
    const Run& run = runs[i];
    const Float8 s = lanes + run.s, unlimited = alpha_of(run, s), alpha = min8(unlimited, eight(kMostAlpha));
    const Float8 through = load8(planes[kThrough] + run.at);
    const Int8 open = through >= kLeastTransmittance;
    const Float8 weight = where8(open, alpha * through);
    store8(planes[kThrough] + run.at, through - weight);
    Float8 value = load8(planes[kAlpha] + run.at);
    for (int c = 0; c < 3; ++c) {
      const Float8 upstream = load8(planes[kRed + c] + run.at);
      value += g.colour[c] * upstream;
      sum_colour[c] += weight * upstream;
    }
    if (kDepth) {
      const Float8 upstream = load8(planes[kDepthPlane] + run.at);
      value += g.depth * upstream;
      sum_depth += weight * upstream;
    }
    const Float8 rest = load8(planes[kRest] + run.at) - weight * value;
    store8(planes[kRest] + run.at, rest);
    const Float8 to_alpha = through * value - rest / (1.0f - alpha);
    const Float8 to_exponent = where8(open & (unlimited < kMostAlpha), to_alpha * alpha), along = to_exponent * s;
    sum_g += to_exponent;
    sum_gs += along;
    sum_gr += to_exponent * run.r;
    sum_gss += along * s;
    sum_gsr += along * run.r;
    sum_grr += to_exponent * (run.r * run.r);
  }
  out.g = sum8(sum_g);
  out.gs = sum8(sum_gs);
  out.gr = sum8(sum_gr);
  out.gss = sum8(sum_gss);
  out.gsr = sum8(sum_gsr);
  out.grr = sum8(sum_grr);
  for (int c = 0; c < 3; ++c) out.colour[c] = sum8(sum_colour[c]);
  out.depth = kDepth ? sum8(sum_depth) : 0.0f;
}

}  // namespace

void draw_splat_tile_backward(const SplatTile& tile, const ConstSplatPlanes& image, const ConstSplatPlanes& upstream,
                              SplatScratch& scratch, SplatSums* sums) {
  load_upstream(tile, image, upstream, scratch);
  for (std::int64_t i = 0; i < tile.count; ++i) {
    const SplatPair pair = tile.pairs[i];
    const SplatRecord& g = tile.records[pair.record];
    const int count = find_runs(g, pair.record, tile, scratch.runs);
    if (upstream.depth) {
      gather<true>(g, scratch.runs, count, scratch, sums[pair.slot]);
    } else {
      gather<false>(g, scratch.runs, count, scratch, sums[pair.slot]);
    }
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
