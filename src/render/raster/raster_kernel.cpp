#include "doppel/render/raster/raster_kernel.h"

#include "doppel/render/raster/raster_resolve.h"
#include "doppel/render/simd.h"

// Compiled without contraction of a*b+c, so that every instruction set gives the same bits.

namespace doppel::kernels::DOPPEL_ISA {
namespace {

/// A face with a larger extent (64 pixels) uses the 64-bit path.
constexpr int kSmallExtent = 64 * kSubpixels;
constexpr int kHalf = kSubpixels / 2;

/// Indices of up to kLanes faces' corners, and their screen records.
struct FaceBatch {
  alignas(64) std::int32_t corner[3][kLanes];
  Float u[3], v[3], iz[3];
};

inline void load_batch(const RasterView& view, const std::int32_t* faces, int count, FaceBatch& batch) {
  alignas(64) std::int32_t present[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) present[lane] = faces[lane < count ? lane : 0];
  load_corners(view.faces, present, batch.corner);
  Float w;
  for (int k = 0; k < 3; ++k) load_records(view.screen, batch.corner[k], batch.u[k], batch.v[k], batch.iz[k], w);
}

inline Int first_lanes(int count) { return lane_numbers() < splat(count); }

/// First and last pixel whose centre may lie between `low` and `high`.
inline Int first_pixel(Int low) { return (low + (kHalf - 1)) >> kSubpixelBits; }
inline Int last_pixel(Int high) { return (high - kHalf) >> kSubpixelBits; }

// --- rows of one triangle --------------------------------------------------------------------------------------------

/// A triangle within a tile: edge functions (>= 0 inside) at the centre of pixel (x0, y0), their steps per pixel, and
/// the plane of 1/z. Edge functions are divided by kSubpixels and rounded down, which keeps their sign at all centres.
struct Edges {
  int x0, y0, x1, y1;  ///< pixels of the tile, end inclusive
  std::int32_t e[3], ex[3], ey[3];
  float iz, izx, izy, iz_min, iz_max;
  std::int32_t face;
};

/// Vectors are those of the tile, not of the face: a load then finds the store of the face before it.
inline void draw_rows(const Edges& t, TileBuffer& tile) {
  const Int lanes = lane_numbers();
  const Float lanes_f = to_float(lanes);
  const Float iz_min = splat(t.iz_min), iz_max = splat(t.iz_max);
  const Int face = splat(t.face);
  for (int x = t.x0 & -kLanes; x <= t.x1; x += kLanes) {
    const int dx = x - t.x0;
    const Int beyond = (splat(t.x1 - x) - lanes) | (lanes + dx);  // negative past the last pixel and before the first
    Int e0 = splat(t.e[0] + dx * t.ex[0]) + lanes * t.ex[0];
    Int e1 = splat(t.e[1] + dx * t.ex[1]) + lanes * t.ex[1];
    Int e2 = splat(t.e[2] + dx * t.ex[2]) + lanes * t.ex[2];
    const Float row_iz = splat(t.iz) + (lanes_f + static_cast<float>(dx)) * t.izx;
    float* depth = tile.inverse_depth + t.y0 * kTileStride + x;
    std::int32_t* id = tile.face + t.y0 * kTileStride + x;
    for (int y = t.y0; y <= t.y1; ++y) {
      const Float iz = min(max(row_iz + static_cast<float>(y - t.y0) * t.izy, iz_min), iz_max);
      const Float before = load<Float>(depth);
      const Mask hit = not_negative(e0 | e1 | e2 | beyond) & greater(iz, before);
      store(depth, choose(hit, iz, before));
      store(id, choose(hit, face, load<Int>(id)));
      e0 += t.ey[0];
      e1 += t.ey[1];
      e2 += t.ey[2];
      depth += kTileStride;
      id += kTileStride;
    }
  }
}

inline void cover_rows(const Edges& t, std::uint64_t* rows) {
  const Int lanes = lane_numbers();
  for (int x = t.x0; x <= t.x1; x += kLanes) {
    const int dx = x - t.x0;
    const Int beyond = splat(t.x1 - x) - lanes;
    Int e0 = splat(t.e[0] + dx * t.ex[0]) + lanes * t.ex[0];
    Int e1 = splat(t.e[1] + dx * t.ex[1]) + lanes * t.ex[1];
    Int e2 = splat(t.e[2] + dx * t.ex[2]) + lanes * t.ex[2];
    for (int y = t.y0; y <= t.y1; ++y) {
      rows[y] |= static_cast<std::uint64_t>(bits_of(not_negative(e0 | e1 | e2 | beyond))) << x;
      e0 += t.ey[0];
      e1 += t.ey[1];
      e2 += t.ey[2];
    }
  }
}

// --- set-up of small faces, a vector at a time -----------------------------------------------------------------------

struct EdgesBatch {
  alignas(64) std::int32_t x0[kLanes], y0[kLanes], x1[kLanes], y1[kLanes];
  alignas(64) std::int32_t e[3][kLanes], ex[3][kLanes], ey[3][kLanes];
  alignas(64) float iz[kLanes], izx[kLanes], izy[kLanes], iz_min[kLanes], iz_max[kLanes];
  Int in_tile;     ///< -1: as `drawn`
  unsigned drawn;  ///< bit per lane: has an area and pixels in this tile
  unsigned large;  ///< bit per lane: too large for 32 bits, to be set up alone
};

struct Corners {
  Int x[3], y[3];
  Float u[3], v[3], iz[3];
};

inline void swap_where(Int condition, Int& a, Int& b) {
  const Int t = condition ? b : a;
  b = condition ? a : b;
  a = t;
}
inline void swap_where(Int condition, Float& a, Float& b) {
  const Float t = condition ? b : a;
  b = condition ? a : b;
  a = t;
}

inline void set_up_plane(const Corners& c, Float centre_u, Float centre_v, EdgesBatch& out) {
  const Float u0 = c.u[0] - centre_u, v0 = c.v[0] - centre_v;
  const Float u10 = c.u[1] - c.u[0], v10 = c.v[1] - c.v[0], u20 = c.u[2] - c.u[0], v20 = c.v[2] - c.v[0];
  const Float z10 = c.iz[1] - c.iz[0], z20 = c.iz[2] - c.iz[0];
  const Float scale = 1.0f / (u10 * v20 - u20 * v10);  // infinite if edge-on; the limits below apply
  const Float izx = (z10 * v20 - z20 * v10) * scale, izy = (u10 * z20 - u20 * z10) * scale;
  store(out.iz, c.iz[0] - u0 * izx - v0 * izy);
  store(out.izx, izx);
  store(out.izy, izy);
  store(out.iz_min, min(min(c.iz[0], c.iz[1]), c.iz[2]));
  store(out.iz_max, max(max(c.iz[0], c.iz[1]), c.iz[2]));
}

inline void set_up_batch(const RasterView& view, const FaceBatch& batch, Int live, int tile_x, int tile_y, bool depth,
                         EdgesBatch& out) {
  Corners c;
  for (int k = 0; k < 3; ++k) {
    c.u[k] = batch.u[k];
    c.v[k] = batch.v[k];
    c.iz[k] = batch.iz[k];
    c.x[k] = round_to_int(c.u[k] * static_cast<float>(kSubpixels));
    c.y[k] = round_to_int(c.v[k] * static_cast<float>(kSubpixels));
  }
  const Int low_x = min(min(c.x[0], c.x[1]), c.x[2]), high_x = max(max(c.x[0], c.x[1]), c.x[2]);
  const Int low_y = min(min(c.y[0], c.y[1]), c.y[2]), high_y = max(max(c.y[0], c.y[1]), c.y[2]);
  const Int small = (high_x - low_x <= kSmallExtent) & (high_y - low_y <= kSmallExtent) & live;
  // Lanes that are not drawn here must not overflow.
  for (int k = 0; k < 3; ++k) {
    c.x[k] = c.x[k] & small;
    c.y[k] = c.y[k] & small;
  }

  // Front faces (counter-clockwise from outside) have a negative area in an image whose y points down.
  Int area = (c.x[1] - c.x[0]) * (c.y[2] - c.y[0]) - (c.x[2] - c.x[0]) * (c.y[1] - c.y[0]);
  const Int turned = area < 0;
  swap_where(turned, c.x[1], c.x[2]);
  swap_where(turned, c.y[1], c.y[2]);
  swap_where(turned, c.u[1], c.u[2]);
  swap_where(turned, c.v[1], c.v[2]);
  swap_where(turned, c.iz[1], c.iz[2]);

  const Int x0 = max(first_pixel(low_x), splat(tile_x)), y0 = max(first_pixel(low_y), splat(tile_y));
  const int last_x = (tile_x + kTile < view.width ? tile_x + kTile : view.width) - 1;
  const int last_y = (tile_y + kTile < view.height ? tile_y + kTile : view.height) - 1;
  const Int x1 = min(last_pixel(high_x), splat(last_x)), y1 = min(last_pixel(high_y), splat(last_y));
  const Int wanted = view.cull ? turned : (area != 0);
  out.in_tile = small & wanted & (x0 <= x1) & (y0 <= y1);
  out.drawn = bits_of(mask_of(out.in_tile));
  out.large = bits_of(mask_of(live & ~small));
  store(out.x0, x0 - tile_x);
  store(out.y0, y0 - tile_y);
  store(out.x1, x1 - tile_x);
  store(out.y1, y1 - tile_y);

  const Int centre_x = (x0 << kSubpixelBits) + kHalf, centre_y = (y0 << kSubpixelBits) + kHalf;
  for (int k = 0; k < 3; ++k) {
    const int next = k == 2 ? 0 : k + 1;
    const Int dx = c.x[next] - c.x[k], dy = c.y[next] - c.y[k];
    const Int owns_edge = (dy < 0) | ((dy == 0) & (dx > 0));                            // left or top edge
    const Int e = dx * (centre_y - c.y[k]) - dy * (centre_x - c.x[k]) - 1 - owns_edge;  // owns_edge is -1 or 0
    store(out.e[k], e >> kSubpixelBits);
    store(out.ex[k], -dy);
    store(out.ey[k], dx);
  }
  if (depth) set_up_plane(c, to_float(x0) + 0.5f, to_float(y0) + 0.5f, out);
}

inline void take_lane(const EdgesBatch& b, int lane, Edges& t) {
  t.x0 = b.x0[lane];
  t.y0 = b.y0[lane];
  t.x1 = b.x1[lane];
  t.y1 = b.y1[lane];
  for (int k = 0; k < 3; ++k) {
    t.e[k] = b.e[k][lane];
    t.ex[k] = b.ex[k][lane];
    t.ey[k] = b.ey[k][lane];
  }
}

// --- set-up of large and cut triangles, one at a time in 64 bits -----------------------------------------------------

struct SnappedTriangle {
  std::int64_t x[3], y[3];
};

inline int clamp_pixel(std::int64_t v, int low, int high) {
  return static_cast<int>(v < low ? low : v > high ? high : v);
}

/// The pixels of the bounding box in the tile; false if there are none.
bool clip_box(const RasterView& view, const SnappedTriangle& s, int tile_x, int tile_y, Edges& t) {
  std::int64_t low_x = s.x[0], high_x = s.x[0], low_y = s.y[0], high_y = s.y[0];
  for (int k = 1; k < 3; ++k) {
    low_x = s.x[k] < low_x ? s.x[k] : low_x;
    high_x = s.x[k] > high_x ? s.x[k] : high_x;
    low_y = s.y[k] < low_y ? s.y[k] : low_y;
    high_y = s.y[k] > high_y ? s.y[k] : high_y;
  }
  const int width = view.width - tile_x < kTile ? view.width - tile_x : kTile;
  const int height = view.height - tile_y < kTile ? view.height - tile_y : kTile;
  t.x0 = clamp_pixel(((low_x + kHalf - 1) >> kSubpixelBits) - tile_x, 0, width);
  t.y0 = clamp_pixel(((low_y + kHalf - 1) >> kSubpixelBits) - tile_y, 0, height);
  t.x1 = clamp_pixel(((high_x - kHalf) >> kSubpixelBits) - tile_x, -1, width - 1);
  t.y1 = clamp_pixel(((high_y - kHalf) >> kSubpixelBits) - tile_y, -1, height - 1);
  return t.x0 <= t.x1 && t.y0 <= t.y1;
}

/// Edge functions of a triangle of any size over the pixels of `t`; false if it covers none of them.
bool set_up_large(const RasterView& view, SnappedTriangle s, int tile_x, int tile_y, Edges& t) {
  const std::int64_t area = (s.x[1] - s.x[0]) * (s.y[2] - s.y[0]) - (s.x[2] - s.x[0]) * (s.y[1] - s.y[0]);
  if (area == 0 || (view.cull && area > 0) || !clip_box(view, s, tile_x, tile_y, t)) return false;
  if (area < 0) {
    const std::int64_t x = s.x[1], y = s.y[1];
    s.x[1] = s.x[2], s.y[1] = s.y[2];
    s.x[2] = x, s.y[2] = y;
  }
  const std::int64_t centre_x = static_cast<std::int64_t>(tile_x + t.x0) * kSubpixels + kHalf;
  const std::int64_t centre_y = static_cast<std::int64_t>(tile_y + t.y0) * kSubpixels + kHalf;
  const std::int64_t columns = t.x1 - t.x0, rows = t.y1 - t.y0;
  for (int k = 0; k < 3; ++k) {
    const int next = k == 2 ? 0 : k + 1;
    const std::int64_t dx = s.x[next] - s.x[k], dy = s.y[next] - s.y[k];
    const bool owns_edge = dy < 0 || (dy == 0 && dx > 0);
    const std::int64_t e = (dx * (centre_y - s.y[k]) - dy * (centre_x - s.x[k]) - (owns_edge ? 0 : 1)) >> kSubpixelBits;
    const std::int64_t ex = -dy * columns, ey = dx * rows;
    const std::int64_t lowest = e + (ex < 0 ? ex : 0) + (ey < 0 ? ey : 0);
    const std::int64_t highest = e + (ex > 0 ? ex : 0) + (ey > 0 ? ey : 0);
    if (highest < 0) return false;
    const bool everywhere = lowest >= 0;  // then e may not fit 32 bits, but is not needed either
    t.e[k] = everywhere ? 0 : static_cast<std::int32_t>(e);
    t.ex[k] = everywhere ? 0 : static_cast<std::int32_t>(-dy);
    t.ey[k] = everywhere ? 0 : static_cast<std::int32_t>(dx);
  }
  return true;
}

void set_up_cut(const RasterView& view, const CutTriangle& cut, int tile_x, int tile_y, bool& drawn, Edges& t) {
  SnappedTriangle s;
  for (int k = 0; k < 3; ++k) s.x[k] = cut.x[k], s.y[k] = cut.y[k];
  drawn = set_up_large(view, s, tile_x, tile_y, t);
  if (!drawn) return;
  t.iz = static_cast<float>(cut.iz + cut.izx * (tile_x + t.x0 + 0.5) + cut.izy * (tile_y + t.y0 + 0.5));
  t.izx = static_cast<float>(cut.izx);
  t.izy = static_cast<float>(cut.izy);
  t.iz_min = cut.iz_min;
  t.iz_max = cut.iz_max;
  t.face = cut.face;
}

void set_up_lane(const RasterView& view, const FaceBatch& batch, int lane, std::int32_t face, CutTriangle& cut) {
  (void)view;
  double u[3], v[3], iz[3];
  for (int k = 0; k < 3; ++k) {
    u[k] = batch.u[k][lane], v[k] = batch.v[k][lane], iz[k] = batch.iz[k][lane];
    cut.x[k] = static_cast<std::int32_t>(std::lrintf(batch.u[k][lane] * kSubpixels));
    cut.y[k] = static_cast<std::int32_t>(std::lrintf(batch.v[k][lane] * kSubpixels));
  }
  const double scale = 1 / ((u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0]));
  cut.izx = ((iz[1] - iz[0]) * (v[2] - v[0]) - (iz[2] - iz[0]) * (v[1] - v[0])) * scale;
  cut.izy = ((u[1] - u[0]) * (iz[2] - iz[0]) - (u[2] - u[0]) * (iz[1] - iz[0])) * scale;
  cut.iz = iz[0] - u[0] * cut.izx - v[0] * cut.izy;
  cut.iz_min = static_cast<float>(std::fmin(std::fmin(iz[0], iz[1]), iz[2]));
  cut.iz_max = static_cast<float>(std::fmax(std::fmax(iz[0], iz[1]), iz[2]));
  cut.face = face;
}

/// Calls draw(Edges, whether it was set up in a batch) for the entries of a tile in their order, and grow(EdgesBatch)
/// for each batch before its entries.
template <bool kDepth, typename Draw, typename Batch>
inline void for_each_triangle(const RasterView& view, const TileWork& work, const Draw& draw, const Batch& grow) {
  FaceBatch batch;
  EdgesBatch edges;
  alignas(64) std::int32_t faces[kLanes];
  for (std::int64_t i = 0; i < work.count; i += kLanes) {
    const int count = work.count - i < kLanes ? static_cast<int>(work.count - i) : kLanes;
    for (int lane = 0; lane < count; ++lane) {
      const std::int32_t entry = work.entries[i + lane];
      faces[lane] = entry >= 0 ? entry : work.cut[~entry].face;
    }
    load_batch(view, faces, count, batch);
    Int live = first_lanes(count);
    unsigned cut_lanes = 0;
    for (int lane = 0; lane < count; ++lane) {
      if (work.entries[i + lane] >= 0) continue;
      live[lane] = 0;
      cut_lanes |= 1u << lane;
    }
    set_up_batch(view, batch, live, work.x0, work.y0, kDepth, edges);
    grow(edges);
    for (unsigned left = edges.drawn | edges.large | cut_lanes; left != 0; left &= left - 1) {
      const int lane = __builtin_ctz(left);
      if ((edges.drawn >> lane) & 1) {
        Edges t;
        take_lane(edges, lane, t);
        if (kDepth) {
          t.iz = edges.iz[lane];
          t.izx = edges.izx[lane];
          t.izy = edges.izy[lane];
          t.iz_min = edges.iz_min[lane];
          t.iz_max = edges.iz_max[lane];
          t.face = faces[lane];
        }
        draw(t, true);
        continue;
      }
      Edges t;
      bool drawn = false;
      if ((cut_lanes >> lane) & 1) {
        set_up_cut(view, work.cut[~work.entries[i + lane]], work.x0, work.y0, drawn, t);
      } else {
        CutTriangle whole;
        set_up_lane(view, batch, lane, faces[lane], whole);
        set_up_cut(view, whole, work.x0, work.y0, drawn, t);
      }
      if (drawn) draw(t, false);
    }
  }
}

inline void grow(TileRect& r, const Edges& t) {
  if (t.x0 < r.x0) r.x0 = static_cast<std::int16_t>(t.x0);
  if (t.y0 < r.y0) r.y0 = static_cast<std::int16_t>(t.y0);
  if (t.x1 >= r.x1) r.x1 = static_cast<std::int16_t>(t.x1 + 1);
  if (t.y1 >= r.y1) r.y1 = static_cast<std::int16_t>(t.y1 + 1);
}

/// The rectangle around what the lanes of batches have drawn.
struct TouchedLanes {
  Int x0 = splat(kTile), y0 = splat(kTile), x1 = splat(-1), y1 = splat(-1);

  void grow(const EdgesBatch& b) {
    x0 = min(x0, b.in_tile ? load<Int>(b.x0) : splat(kTile));
    y0 = min(y0, b.in_tile ? load<Int>(b.y0) : splat(kTile));
    x1 = max(x1, b.in_tile ? load<Int>(b.x1) : splat(-1));
    y1 = max(y1, b.in_tile ? load<Int>(b.y1) : splat(-1));
  }
  void add_to(TileRect& r) const {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (x0[lane] < r.x0) r.x0 = static_cast<std::int16_t>(x0[lane]);
      if (y0[lane] < r.y0) r.y0 = static_cast<std::int16_t>(y0[lane]);
      if (x1[lane] >= r.x1) r.x1 = static_cast<std::int16_t>(x1[lane] + 1);
      if (y1[lane] >= r.y1) r.y1 = static_cast<std::int16_t>(y1[lane] + 1);
    }
  }
};

// --- finished pixels -------------------------------------------------------------------------------------------------

inline void write_pixels(const RasterOutput& out, std::int64_t pixel, int count, Int face, const Pixels& p) {
  if (count >= kLanes) {
    if (out.face_id) store(out.face_id + pixel, face);
    if (out.depth) store(out.depth + pixel, p.z);
    if (out.barycentrics) store_interleaved(out.barycentrics + 3 * pixel, p.b);
    return;
  }
  float b[3 * kLanes];
  store_interleaved(b, p.b);
  if (out.face_id) std::memcpy(out.face_id + pixel, &face, 4 * static_cast<unsigned>(count));
  if (out.depth) std::memcpy(out.depth + pixel, &p.z, 4 * static_cast<unsigned>(count));
  if (out.barycentrics) std::memcpy(out.barycentrics + 3 * pixel, b, 12 * static_cast<unsigned>(count));
}

}  // namespace

void project_vertices(const RasterView& view, std::int64_t begin, std::int64_t end) {
  const float* m = view.matrix;
  const Float4 cx = {m[0], m[4], m[8], 0}, cy = {m[1], m[5], m[9], 0}, cz = {m[2], m[6], m[10], 0};
  const Float4 c1 = {m[3], m[7], m[11], 0};
  for (std::int64_t i = begin; i < end; ++i) {
    const float* x = view.vertices + 3 * i;
    const Float4 h = cx * x[0] + cy * x[1] + cz * x[2] + c1;
    const float w = h[2], iz = 1.0f / w, u = h[0] * iz, v = h[1] * iz;
    const bool inside =
        w >= view.z_near && w <= 1e30f && u >= kGuardMin && u <= kGuardMax && v >= kGuardMin && v <= kGuardMax;
    const Float4 record = {inside ? u : 0.0f, inside ? v : 0.0f, inside ? iz : 0.0f, w};
    std::memcpy(view.screen + 4 * i, &record, sizeof record);
  }
}

std::int64_t bound_faces(const RasterView& view, std::int64_t begin, std::int64_t end, FaceTiles* out) {
  FaceBatch batch;
  alignas(64) std::int32_t faces[kLanes], tx0[kLanes], ty0[kLanes], tx1[kLanes], ty1[kLanes];
  std::int64_t written = 0;
  for (std::int64_t i = begin; i < end; i += kLanes) {
    const int count = end - i < kLanes ? static_cast<int>(end - i) : kLanes;
    for (int lane = 0; lane < count; ++lane) faces[lane] = static_cast<std::int32_t>(i + lane);
    load_batch(view, faces, count, batch);
    Int x[3], y[3];
    for (int k = 0; k < 3; ++k) {
      x[k] = round_to_int(batch.u[k] * static_cast<float>(kSubpixels));
      y[k] = round_to_int(batch.v[k] * static_cast<float>(kSubpixels));
    }
    const Int x0 = max(first_pixel(min(min(x[0], x[1]), x[2])), Int{});
    const Int y0 = max(first_pixel(min(min(y[0], y[1]), y[2])), Int{});
    const Int x1 = min(last_pixel(max(max(x[0], x[1]), x[2])), splat(view.width - 1));
    const Int y1 = min(last_pixel(max(max(y[0], y[1]), y[2])), splat(view.height - 1));
    const Int whole = (batch.iz[0] > 0) & (batch.iz[1] > 0) & (batch.iz[2] > 0);
    const Int live = first_lanes(count);
    const unsigned cut = bits_of(mask_of(live & ~whole));
    unsigned left = bits_of(mask_of(live & whole & (x0 <= x1) & (y0 <= y1))) | cut;
    store(tx0, x0 / kTile);
    store(ty0, y0 / kTile);
    store(tx1, x1 / kTile);
    store(ty1, y1 / kTile);
    for (; left != 0; left &= left - 1) {
      const int lane = __builtin_ctz(left);
      FaceTiles& f = out[written++];
      f.face = faces[lane];
      f.x0 = ((cut >> lane) & 1) ? std::int16_t{-1} : static_cast<std::int16_t>(tx0[lane]);
      f.y0 = static_cast<std::int16_t>(ty0[lane]);
      f.x1 = static_cast<std::int16_t>(tx1[lane]);
      f.y1 = static_cast<std::int16_t>(ty1[lane]);
    }
  }
  return written;
}

void draw_tile(const RasterView& view, const TileWork& work, TileBuffer& tile, TileRect& touched) {
  TouchedLanes lanes;
  TileRect rect = touched;
  for_each_triangle<true>(
      view, work,
      [&](const Edges& t, bool in_batch) {
        if (!in_batch) grow(rect, t);
        draw_rows(t, tile);
      },
      [&](const EdgesBatch& batch) { lanes.grow(batch); });
  lanes.add_to(rect);
  touched = rect;
}

void cover_tile(const RasterView& view, const TileWork& work, std::uint64_t* rows) {
  for_each_triangle<false>(
      view, work, [&](const Edges& t, bool) { cover_rows(t, rows); }, [](const EdgesBatch&) {});
}

void resolve_tile(const RasterView& view, int x0, int y0, TileRect rect, TileBuffer& tile, const RasterOutput& out) {
  const int width = view.width - x0 < kTile ? view.width - x0 : kTile;
  const int first = rect.x0 / kLanes * kLanes;  // whole vectors, because pixels around the rectangle are background
  const Float lanes = to_float(lane_numbers());
  const Float far_away = splat(__builtin_inff());
  const bool faces_alone = out.depth == nullptr && out.barycentrics == nullptr;
  for (int y = rect.y0; y < rect.y1; ++y) {
    for (int x = first; x < rect.x1; x += kLanes) {
      std::int32_t* faces = tile.face + y * kTileStride + x;
      const Int face = load<Int>(faces);
      const Int covered = face >= 0;
      Pixels p{{Float{}, Float{}, Float{}}, far_away};
      if (!faces_alone && bits_of(mask_of(covered)) != 0) {
        alignas(64) std::int32_t corner[3][kLanes];
        p = resolve_pixels(view, faces, lanes + (static_cast<float>(x0 + x) + 0.5f),
                           splat(static_cast<float>(y0 + y) + 0.5f), corner);
        for (Float& b : p.b) b = covered ? b : Float{};
        p.z = covered ? p.z : far_away;
      }
      write_pixels(out, static_cast<std::int64_t>(y0 + y) * view.width + x0 + x, width - x, face, p);
      store(faces, splat(-1));
      store(tile.inverse_depth + y * kTileStride + x, Float{});
    }
  }
}

void pixel_barycentrics(const RasterView& view, const std::int32_t* faces, const std::int32_t* x, const std::int32_t* y,
                        std::int64_t count, float* out) {
  for (std::int64_t i = 0; i < count; i += kLanes) {
    const std::int64_t lanes = count - i < kLanes ? count - i : kLanes;
    alignas(64) std::int32_t face[kLanes], column[kLanes], row[kLanes], corner[3][kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      const std::int64_t from = lane < lanes ? i + lane : i;
      face[lane] = faces[from];
      column[lane] = x[from];
      row[lane] = y[from];
    }
    const Pixels p =
        resolve_pixels(view, face, to_float(load<Int>(column)) + 0.5f, to_float(load<Int>(row)) + 0.5f, corner);
    float together[3 * kLanes];
    store_interleaved(together, p.b);
    std::memcpy(out + 3 * i, together, static_cast<std::size_t>(3 * lanes) * sizeof(float));
  }
}

std::int64_t outline_columns(const std::int32_t* row, std::int64_t stride, int begin, int end, std::int32_t* columns) {
  std::int64_t count = 0;
  for (int x = begin; x < end; x += kLanes) {
    const std::int32_t* at = row + x;
    const Int face = load<Int>(at);
    // A negative number, uncovered, makes the whole negative.
    const Int neighbours = load<Int>(at - 1) | load<Int>(at + 1) | load<Int>(at - stride) | load<Int>(at + stride);
    unsigned bits = bits_of(mask_of((face >= 0) & (neighbours < 0)));
    if (end - x < kLanes) bits &= (1u << (end - x)) - 1u;
    for (; bits != 0; bits &= bits - 1) columns[count++] = x + __builtin_ctz(bits);
  }
  return count;
}

}  // namespace doppel::kernels::DOPPEL_ISA
