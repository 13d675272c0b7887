#include "doppel/render/shading/shading_kernel.h"

#include "doppel/render/lighting/sh_lanes.h"
#include "doppel/render/raster/raster_resolve.h"
#include "doppel/render/simd.h"

namespace doppel::kernels::DOPPEL_ISA {
namespace {

/// A vector of pixels that the mesh covers at least in part: position, then face (-1: none), three barycentrics, depth,
/// and texture coordinates if there is a texture.
constexpr int kFragmentWords = 16 + 7 * kLanes;  // the position has its own cache line, which aligns the rest
constexpr int kVectorsPerTile = kTile * kTile / kLanes;

struct Fragment {
  int x, y;  ///< of the first pixel, in the image
  Int face;
  Float b[3], z;
  Float u, v;  ///< on the texture; not set without a texture
};

inline void store_fragment(std::int32_t* out, const Fragment& f, bool textured) {
  out[0] = f.x;
  out[1] = f.y;
  store(out + 16, f.face);
  for (int k = 0; k < 3; ++k) store(out + 16 + (k + 1) * kLanes, f.b[k]);
  store(out + 16 + 4 * kLanes, f.z);
  if (!textured) return;
  store(out + 16 + 5 * kLanes, f.u);
  store(out + 16 + 6 * kLanes, f.v);
}

inline Fragment load_fragment(const std::int32_t* in, bool textured) {
  Fragment f;
  f.x = in[0];
  f.y = in[1];
  f.face = load<Int>(in + 16);
  for (int k = 0; k < 3; ++k) f.b[k] = load<Float>(in + 16 + (k + 1) * kLanes);
  f.z = load<Float>(in + 16 + 4 * kLanes);
  f.u = textured ? load<Float>(in + 16 + 5 * kLanes) : Float{};
  f.v = textured ? load<Float>(in + 16 + 6 * kLanes) : Float{};
  return f;
}

typedef std::uint8_t Bytes __attribute__((vector_size(kLanes)));

inline Float dot(const Float* a, const Float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Float zero() { return Float{}; }

inline void load_corners(const RasterView& raster, Int face, std::int32_t (*corner)[kLanes]) {
  alignas(64) std::int32_t faces[kLanes];
  store(faces, max(face, Int{}));
  for (int lane = 0; lane < kLanes; ++lane) {
    const std::int32_t* f = raster.faces + 4 * static_cast<std::int64_t>(faces[lane]);
    for (int k = 0; k < 3; ++k) corner[k][lane] = f[k];
  }
}

// --- normal and light ------------------------------------------------------------------------------------------------

/// The interpolated normal; `scale` is 1 / length, negative for a flipped normal, 0 without a normal.
struct Normal {
  Float corner[3][3];  ///< [corner][axis]
  Float n[3], scale;
};

constexpr float kTinyNormal = 1e-30f;  // square of a length in square metres

inline void interpolate_normal(const ShadeView& view, const std::int32_t (*corner)[kLanes], const Fragment& f,
                               Normal& out) {
  Float sum[3] = {zero(), zero(), zero()}, unused;
  for (int k = 0; k < 3; ++k) {
    load_records(view.normals, corner[k], out.corner[k][0], out.corner[k][1], out.corner[k][2], unused);
    for (int d = 0; d < 3; ++d) sum[d] += f.b[k] * out.corner[k][d];
  }
  const Float square = dot(sum, sum);
  const Int solid = square > kTinyNormal;
  Float scale = 1.0f / square_root(solid ? square : splat(1.0f));
  if (view.flip) {
    const Float u = to_float(lane_numbers()) + (static_cast<float>(f.x) + 0.5f);
    const float v = static_cast<float>(f.y) + 0.5f;
    Float away = zero();
    for (int d = 0; d < 3; ++d) {
      away += sum[d] * (u * view.ray[3 * d] + (view.ray[3 * d + 1] * v + view.ray[3 * d + 2]));
    }
    scale = away > 0 ? -scale : scale;
  }
  out.scale = solid ? scale : zero();
  for (int d = 0; d < 3; ++d) out.n[d] = sum[d] * out.scale;
}

/// Gradient to the normal sums, from the gradient `g_light` to the light.
inline void normal_gradient(const float* lighting, const Float* g_light, const Normal& normal, Float* out) {
  Float s[9];
  for (int j = 1; j < 9; ++j)
    s[j] = g_light[0] * lighting[j] + g_light[1] * lighting[9 + j] + g_light[2] * lighting[18 + j];
  const Float x = normal.n[0], y = normal.n[1], z = normal.n[2];
  const Float g[3] = {s[3] + s[4] * y + s[7] * z + 2.0f * s[8] * x, s[1] + s[4] * x + s[5] * z - 2.0f * s[8] * y,
                      s[2] + s[5] * y + 6.0f * s[6] * z + s[7] * x};
  const Float along = dot(g, normal.n);
  for (int d = 0; d < 3; ++d) out[d] = (g[d] - normal.n[d] * along) * normal.scale;
}

// --- texture ---------------------------------------------------------------------------------------------------------

struct Sample {
  Float value[3];
  Float du[3], dv[3];  ///< derivatives with respect to u and v
};

/// The left texel and the fraction of a coordinate in texels; `inside`: the coordinate is not clamped.
inline void split(Float x, int size, bool nearest, Int& texel, Float& fraction, Int& inside) {
  const auto last = static_cast<float>(size - 1);
  if (nearest) x = to_float(__builtin_convertvector(min(max(x + 0.5f, zero()), splat(last)), Int));
  inside = (x >= 0) & (x <= last);
  x = min(max(x, zero()), splat(last));
  texel = min(__builtin_convertvector(x, Int), splat(size - 2));
  fraction = x - to_float(texel);
}

/// Left and right texel of a row, from two overlapping reads that stay within the row.
inline void load_pair(const float* texture, const std::int32_t* offset, Float* left, Float* right) {
  Float again;
  load_quads<1>(texture, offset, left[0], left[1], left[2], right[0]);
  load_quads<1>(texture + 2, offset, again, right[0], right[1], right[2]);
}

/// UVs of the corners of each pixel's face.
struct CornerUvs {
  Float u[3], v[3];
};

inline CornerUvs corner_uvs(const ShadeView& view, Int face) {
  CornerUvs out;
  alignas(64) std::int32_t record[kLanes];
  const Int covered = max(face, Int{});
  store(record, covered * 2);
  Float unused0, unused1;
  load_records(view.uvs, record, out.u[0], out.v[0], out.u[1], out.v[1]);
  store(record, covered * 2 + 1);
  load_records(view.uvs, record, out.u[2], out.v[2], unused0, unused1);
  return out;
}

inline void find_uv(const ShadeView& view, Fragment& f) {
  const CornerUvs corner = corner_uvs(view, f.face);
  f.u = dot(f.b, corner.u);
  f.v = dot(f.b, corner.v);
}

/// The position of each pixel on the texture.
struct TexturePosition {
  Int texel, inside_x, inside_y;
  Float fx, fy;
  alignas(64) std::int32_t offset[kLanes];
};

inline void find_position(const ShadeView& view, const Fragment& f, TexturePosition& p) {
  const auto width = static_cast<float>(view.texture_width), height = static_cast<float>(view.texture_height);
  Int tx, ty;
  split(f.u * width - 0.5f, view.texture_width, view.nearest, tx, p.fx, p.inside_x);
  split((1.0f - f.v) * height - 0.5f, view.texture_height, view.nearest, ty, p.fy, p.inside_y);
  p.texel = ty * view.texture_width + tx;
  store(p.offset, p.texel * 3);
}

/// Texels are scattered in memory: a prefetch before other work hides the latency.
inline void prefetch_texels(const ShadeView& view, const TexturePosition& p) {
  const std::int64_t row = 3 * static_cast<std::int64_t>(view.texture_width);
  for (int lane = 0; lane < kLanes; ++lane) {
    __builtin_prefetch(view.texture + p.offset[lane]);
    __builtin_prefetch(view.texture + p.offset[lane] + row);
  }
}

/// Prefetches texels. Call it one vector of pixels before sample_texture.
inline void look_ahead(const ShadeView& view, const Fragment& f, TexturePosition& position) {
  if (!view.texture) return;
  find_position(view, f, position);
  prefetch_texels(view, position);
}

inline void sample_texture(const ShadeView& view, const TexturePosition& p, bool derivative, Sample& s) {
  Float top_left[3], top_right[3], bottom_left[3], bottom_right[3];
  load_pair(view.texture, p.offset, top_left, top_right);
  load_pair(view.texture + 3 * static_cast<std::int64_t>(view.texture_width), p.offset, bottom_left, bottom_right);
  for (int c = 0; c < 3; ++c) {
    const Float step_top = top_right[c] - top_left[c], step_bottom = bottom_right[c] - bottom_left[c];
    const Float top = top_left[c] + p.fx * step_top, bottom = bottom_left[c] + p.fx * step_bottom;
    s.value[c] = top + p.fy * (bottom - top);
    if (!derivative) continue;
    const auto width = static_cast<float>(view.texture_width), height = static_cast<float>(view.texture_height);
    s.du[c] = p.inside_x ? (step_top + p.fy * (step_bottom - step_top)) * width : zero();
    s.dv[c] = p.inside_y ? (top - bottom) * height : zero();
  }
}

// --- images ----------------------------------------------------------------------------------------------------------

inline void store_pixels(float* out, int count, const Float* colour) {
  if (count >= kLanes) {
    store_interleaved(out, colour);
    return;
  }
  float rows[3 * kLanes];
  store_interleaved(rows, colour);
  std::memcpy(out, rows, 12 * static_cast<unsigned>(count));
}

inline void load_pixels(const float* in, int count, Float* colour) {
#if defined(__AVX512F__)
  if (count >= kLanes) {
    alignas(64) static const std::int32_t kFirst[3][16] = {{0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30, 0, 0, 0, 0, 0},
                                                           {1, 4, 7, 10, 13, 16, 19, 22, 25, 28, 31, 0, 0, 0, 0, 0},
                                                           {2, 5, 8, 11, 14, 17, 20, 23, 26, 29, 0, 0, 0, 0, 0, 0}};
    alignas(64) static const std::int32_t kSecond[3][16] = {{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 17, 20, 23, 26, 29},
                                                            {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 18, 21, 24, 27, 30},
                                                            {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 19, 22, 25, 28, 31}};
    const __m512 a = _mm512_loadu_ps(in), b = _mm512_loadu_ps(in + 16), c = _mm512_loadu_ps(in + 32);
    for (int k = 0; k < 3; ++k) {
      const __m512 two = _mm512_permutex2var_ps(a, _mm512_load_si512(kFirst[k]), b);
      colour[k] = (Float)_mm512_permutex2var_ps(two, _mm512_load_si512(kSecond[k]), c);
    }
    return;
  }
#endif
  float rows[3 * kLanes] = {};
  std::memcpy(rows, in, 12 * static_cast<unsigned>(count < kLanes ? count : kLanes));
  for (int lane = 0; lane < kLanes; ++lane) {
    for (int k = 0; k < 3; ++k) colour[k][lane] = rows[3 * lane + k];
  }
}

/// Writes 0 to the pixels of the tile outside columns [x_begin, x_end) of rows [y_begin, y_end).
void clear_around(const RasterView& raster, int x0, int y0, int x_begin, int x_end, int y_begin, int y_end,
                  const TileImage& image) {
  const int width = raster.width - x0 < kTile ? raster.width - x0 : kTile;
  const int height = raster.height - y0 < kTile ? raster.height - y0 : kTile;
  for (int y = 0; y < height; ++y) {
    const bool drawn = y >= y_begin && y < y_end;
    const int left = drawn ? x_begin : width, right = drawn && x_end < width ? x_end : width;
    const std::int64_t row = y * image.stride;
    if (image.colour) {
      std::memset(image.colour + 3 * row, 0, 12 * static_cast<unsigned>(left));
      std::memset(image.colour + 3 * (row + right), 0, 12 * static_cast<unsigned>(width - right));
    }
    if (image.mask) {
      std::memset(image.mask + row, 0, static_cast<unsigned>(left));
      std::memset(image.mask + row + right, 0, static_cast<unsigned>(width - right));
    }
  }
}

/// A resolved vector of pixels whose texels are being loaded.
struct Waiting {
  Fragment f;
  TexturePosition position;
  alignas(64) std::int32_t corner[3][kLanes];
};

inline void shade_pixels(const ShadeView& view, const Waiting& w, Float* colour) {
  for (int c = 0; c < 3; ++c) colour[c] = splat(1.0f);
  if (view.normals) {
    Normal normal;
    interpolate_normal(view, w.corner, w.f, normal);
    Float sh[9];
    basis(normal.n, sh);
    illuminate(view.lighting, sh, colour);
  }
  if (view.texture) {
    Sample s;
    sample_texture(view, w.position, false, s);
    for (int c = 0; c < 3; ++c) colour[c] *= s.value[c];
  }
  for (int c = 0; c < 3; ++c) colour[c] = w.f.face >= 0 ? colour[c] : zero();
}

// --- sums per face ---------------------------------------------------------------------------------------------------

/// The record of a face within the tile, created at its first pixel.
inline FaceGradient& record_of(const RasterView& raster, std::int32_t face, TileGradient& out) {
  std::int32_t& slot = out.slot_of_face[face];
  if (slot < out.num_faces && out.faces[slot].face == face) return out.faces[slot];
  slot = out.num_faces++;
  FaceGradient& record = out.faces[slot];
  record.face = face;
  for (int k = 0; k < 3; ++k) record.corner[k] = raster.faces[4 * static_cast<std::int64_t>(face) + k];
  std::memset(record.sum, 0, sizeof record.sum);
  return record;
}

/// Adds b_k * values to corner k of each pixel's face, from left to right. Neighbouring pixels of the same face are
/// added together. Without kNormals the last three values are 0.
template <bool kNormals>
inline void add_to_faces(const RasterView& raster, const Fragment& f, const Float* values, TileGradient& out) {
  alignas(64) float low[4 * kLanes], high[4 * kLanes], b[4 * kLanes];
  alignas(64) std::int32_t faces[kLanes];
  store_quads(low, values[0], values[1], values[2], zero());
  if (kNormals) store_quads(high, values[3], values[4], values[5], zero());
  store_quads(b, f.b[0], f.b[1], f.b[2], zero());
  store(faces, f.face);
  for (int lane = 0; lane < kLanes;) {
    const std::int32_t face = faces[lane];
    if (face < 0) {
      ++lane;
      continue;
    }
    FaceGradient& record = record_of(raster, face, out);
    Float4 sum[3], normal_sum[3];
    for (int k = 0; k < 3; ++k) {
      sum[k] = load<Float4>(record.sum[k]);
      if (kNormals) normal_sum[k] = load<Float4>(record.sum[k] + 4);
    }
    do {
      for (int k = 0; k < 3; ++k) {
        sum[k] += b[4 * lane + k] * load<Float4>(low + 4 * lane);
        if (kNormals) normal_sum[k] += b[4 * lane + k] * load<Float4>(high + 4 * lane);
      }
    } while (++lane < kLanes && faces[lane] == face);
    for (int k = 0; k < 3; ++k) {
      store(record.sum[k], sum[k]);
      if (kNormals) store(record.sum[k] + 4, normal_sum[k]);
    }
  }
}

inline void cross(const float* a, const float* b, float* out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}
inline float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Without light, the gradient to barycentric j is du (u_j - u) + dv (v_j - v). This function converts the sums over
/// du, dv and their products with (u, v) to sums over barycentrics, once per face.
inline void sums_over_barycentrics(const ShadeView& view, FaceGradient& record) {
  const float* uv = view.uvs + 8 * static_cast<std::int64_t>(record.face);
  for (auto& sum : record.sum) {
    const float du = sum[0], dv = sum[1], along = sum[2];
    for (int j = 0; j < 3; ++j) sum[j] = du * uv[2 * j] + dv * uv[2 * j + 1] - along;
  }
}

/// From the sums over barycentrics to the corners: with r_k from the camera centre to corner k and W = [r_0 r_1 r_2],
/// b is W^-1 d scaled to a sum of 1, hence dL/dr_k = -W^-T sum(b_k a), a the gradient to b without its part along b.
inline void finish_face(const ShadeView& view, FaceGradient& record) {
  constexpr float kGrazing = 0.001f;
  const float* x[3];
  for (int k = 0; k < 3; ++k) x[k] = view.raster->vertices + 3 * static_cast<std::int64_t>(record.corner[k]);
  float r[3], p[3], q[3], n[3], w[3][3];
  for (int d = 0; d < 3; ++d) {
    r[d] = x[0][d] - view.centre[d];
    p[d] = x[1][d] - x[0][d];
    q[d] = x[2][d] - x[0][d];
  }
  cross(p, q, n);
  cross(q, r, w[1]);  // r_2 x r_0
  cross(r, p, w[2]);  // r_0 x r_1
  for (int d = 0; d < 3; ++d) w[0][d] = n[d] - w[1][d] - w[2][d];
  const float volume = dot(r, n);
  const bool grazing = !(volume * volume > kGrazing * kGrazing * dot(r, r) * dot(n, n));
  const float scale = grazing ? 0.0f : -1.0f / volume;
  for (auto& sum : record.sum) {
    float g[3];
    for (int d = 0; d < 3; ++d) g[d] = scale * (sum[0] * w[0][d] + sum[1] * w[1][d] + sum[2] * w[2][d]);
    for (int d = 0; d < 3; ++d) sum[d] = g[d];
  }
}

// --- one vector of pixels backward -----------------------------------------------------------------------------------

/// Prefetches the upstream gradient of a later fragment. The hardware prefetcher does not predict the distance between
/// rows of an image.
inline void prefetch_upstream(const float* upstream, int width, const std::int32_t* fragment) {
  const float* pixel = upstream + 3 * (static_cast<std::int64_t>(fragment[1]) * width + fragment[0]);
  for (int i = 0; i < 3 * kLanes; i += 16) __builtin_prefetch(pixel + i);
}

/// The sums of a tile in registers and on the stack.
struct LightSums {
  Float sum[27];
};

inline void append_texels(const TexturePosition& p, const Float* gradient, Int face, TileGradient& out) {
  alignas(64) std::int32_t faces[kLanes], texel[kLanes];
  alignas(64) float fx[kLanes], fy[kLanes], g[3][kLanes];
  store(faces, face);
  store(texel, p.texel);
  store(fx, p.fx);
  store(fy, p.fy);
  for (int c = 0; c < 3; ++c) store(g[c], gradient[c]);
  for (int lane = 0; lane < kLanes; ++lane) {
    if (faces[lane] < 0) continue;
    out.texels[out.num_texels++] = {texel[lane], fx[lane], fy[lane], {g[0][lane], g[1][lane], g[2][lane]}};
  }
}

inline void backward_pixels(const ShadeView& view, const Fragment& f, const TexturePosition& position, const Float* g,
                            TileGradient& out, LightSums& light_sums) {
  Normal normal;
  Sample s;
  Float light[3] = {splat(1.0f), splat(1.0f), splat(1.0f)}, sh[9];
  if (view.normals) {
    alignas(64) std::int32_t corner[3][kLanes];
    load_corners(*view.raster, f.face, corner);
    interpolate_normal(view, corner, f, normal);
    basis(normal.n, sh);
    illuminate(view.lighting, sh, light);
  }
  const bool gradients = out.faces && !view.nearest;
  if (view.texture && (gradients || view.normals)) sample_texture(view, position, gradients, s);

  Float values[6] = {zero(), zero(), zero(), zero(), zero(), zero()};
  if (view.normals) {
    Float g_light[3];
    for (int c = 0; c < 3; ++c) g_light[c] = view.texture ? g[c] * s.value[c] : g[c];
    if (out.lighting) {
      for (int c = 0; c < 3; ++c) {
        for (int j = 0; j < 9; ++j) light_sums.sum[9 * c + j] += g_light[c] * sh[j];
      }
    }
    if (out.faces) {
      normal_gradient(view.lighting, g_light, normal, values + 3);
      for (int k = 0; k < 3; ++k) values[k] += dot(values + 3, normal.corner[k]);
    }
  }
  Float du = zero(), dv = zero();
  if (view.texture) {
    Float g_albedo[3];
    for (int c = 0; c < 3; ++c) g_albedo[c] = g[c] * light[c];
    if (out.texels) append_texels(position, g_albedo, f.face, out);
    if (gradients) {
      du = dot(g_albedo, s.du);
      dv = dot(g_albedo, s.dv);
    }
  }
  if (!out.faces) return;
  const Int within = (f.b[0] > 0) & (f.b[1] > 0) & (f.b[2] > 0);  // b of a pixel moved to an edge is constant
  if (!view.normals) {
    values[0] = within ? du : zero();
    values[1] = within ? dv : zero();
    values[2] = values[0] * f.u + values[1] * f.v;
    add_to_faces<false>(*view.raster, f, values, out);
    return;
  }
  if (view.texture) {
    const CornerUvs corner = corner_uvs(view, f.face);
    for (int k = 0; k < 3; ++k) values[k] += du * corner.u[k] + dv * corner.v[k];
  }
  const Float along = dot(f.b, values);
  for (int k = 0; k < 3; ++k) values[k] = within ? values[k] - along : zero();
  add_to_faces<true>(*view.raster, f, values, out);
}

// --- gradient of the target ------------------------------------------------------------------------------------------

/// Sums weight_u and weight_v times the target around `count` pixels from (x, y) on, times `upstream`, for each float
/// of the interleaved row. The row must lie `radius` inside the image.
inline void correlate(const TargetView& view, int x, int y, int count, const float* upstream, float* du, float* dv) {
  const int floats = 3 * count, r = view.radius;
  const std::int64_t stride = 3 * static_cast<std::int64_t>(view.raster->width);
  float sum_u[3 * kLanes] = {}, sum_v[3 * kLanes] = {}, norm = 0;
  for (int j = -r; j <= r; ++j) {
    for (int i = -r; i <= r; ++i) {
      if (i == 0 && j == 0) continue;
      const float scale = 1.0f / static_cast<float>(i * i + j * j);
      const float wu = static_cast<float>(i) * scale, wv = static_cast<float>(j) * scale;
      norm += static_cast<float>(i * i) * scale;
      const float* row = view.target + (y + j) * stride + 3 * (x + i);
      for (int k = 0; k < floats; ++k) {
        sum_u[k] += wu * row[k];
        sum_v[k] += wv * row[k];
      }
    }
  }
  for (int p = 0; p < count; ++p) {
    float u = 0, v = 0;
    for (int c = 0; c < 3; ++c) {
      u += upstream[3 * p + c] * sum_u[3 * p + c];
      v += upstream[3 * p + c] * sum_v[3 * p + c];
    }
    du[p] = u / norm;
    dv[p] = v / norm;
  }
}

/// Gradient of (upstream . target) along u and v at the pixels of a fragment; 0 where it is not defined.
inline void target_gradients(const TargetView& view, const Fragment& f, const float* upstream, Float& du, Float& dv) {
  alignas(64) float u[kLanes] = {}, v[kLanes] = {};
  const int width = view.raster->width, height = view.raster->height, r = view.radius;
  const int begin = f.x > r ? f.x : r, end = f.x + kLanes < width - r ? f.x + kLanes : width - r;
  if (f.y >= r && f.y < height - r && begin < end) {
    const float* g = upstream + 3 * (static_cast<std::int64_t>(f.y) * width + begin);
    correlate(view, begin, f.y, end - begin, g, u + (begin - f.x), v + (begin - f.x));
  }
  du = f.face >= 0 ? load<Float>(u) : zero();
  dv = f.face >= 0 ? load<Float>(v) : zero();
}

}  // namespace

std::int64_t fragment_words() { return static_cast<std::int64_t>(kVectorsPerTile) * kFragmentWords; }

std::int32_t shade_tile(const ShadeView& view, int x0, int y0, TileRect rect, TileBuffer& tile, const TileImage& image,
                        std::int32_t* fragments) {
  const RasterView& raster = *view.raster;
  const int width = raster.width - x0 < kTile ? raster.width - x0 : kTile;
  const bool any = rect.x1 > rect.x0;
  const int first = rect.x0 / kLanes * kLanes, last = (rect.x1 + kLanes - 1) / kLanes * kLanes;
  clear_around(raster, x0, y0, any ? first : 0, any ? last : 0, any ? rect.y0 : 0, any ? rect.y1 : 0, image);
  std::int32_t count = 0;
  if (!any) return 0;
  const Float lanes = to_float(lane_numbers());
  const Float background[3] = {zero(), zero(), zero()};
  Waiting waiting[2];
  int turn = 0;
  bool pending = false;
  const auto inside_of = [&](int x) { return width - x < kLanes ? width - x : kLanes; };
  const auto finish = [&](const Waiting& w) {
    Float pixel[3];
    shade_pixels(view, w, pixel);
    const int x = w.f.x - x0, y = w.f.y - y0;
    store_pixels(image.colour + 3 * (y * image.stride + x), inside_of(x), pixel);
  };
  for (int y = rect.y0; y < rect.y1; ++y) {
    for (int x = first; x < rect.x1; x += kLanes) {
      std::int32_t* faces = tile.face + y * kTileStride + x;
      const Int face = load<Int>(faces), covered = face >= 0;
      const std::int64_t pixel = y * image.stride + x;
      if (image.mask) {
        const Bytes bytes = __builtin_convertvector(-covered, Bytes);
        std::memcpy(image.mask + pixel, &bytes, static_cast<unsigned>(inside_of(x)));
      }
      if (bits_of(mask_of(covered)) == 0) {
        if (image.colour) store_pixels(image.colour + 3 * pixel, inside_of(x), background);
        continue;
      }
      Waiting& w = waiting[turn];
      w.f.x = x0 + x;
      w.f.y = y0 + y;
      w.f.face = face;
      const Pixels p = resolve_pixels(raster, faces, lanes + (static_cast<float>(w.f.x) + 0.5f),
                                      splat(static_cast<float>(w.f.y) + 0.5f), w.corner);
      for (int k = 0; k < 3; ++k) w.f.b[k] = covered ? p.b[k] : zero();
      w.f.z = covered ? p.z : splat(1.0f);
      store(faces, splat(-1));
      store(tile.inverse_depth + y * kTileStride + x, zero());
      if (view.texture) find_uv(view, w.f);
      if (fragments) {
        store_fragment(fragments + static_cast<std::int64_t>(count++) * kFragmentWords, w.f, view.texture != nullptr);
      }
      if (!image.colour) continue;
      look_ahead(view, w.f, w.position);
      if (pending) finish(waiting[1 - turn]);
      pending = true;
      turn = 1 - turn;
    }
  }
  if (pending) finish(waiting[1 - turn]);
  return count;
}

void sum_samples(const TileImage& image, int x0, int y0, TileRect rect, const TileCells& out) {
  const int f = out.factor, first_column = x0 / f, first_row = y0 / f;
  for (int y = rect.y0; y < rect.y1;) {
    // The samples of one row of cells, summed over their rows.
    float colour[3 * kTile], covered[kTile];
    const int width = rect.x1 - rect.x0, row = (y0 + y) / f;
    for (int x = 0; x < 3 * width; ++x) colour[x] = 0.0f;
    for (int x = 0; x < width; ++x) covered[x] = 0.0f;
    for (; y < rect.y1 && (y0 + y) / f == row; ++y) {
      const float* from = image.colour + 3 * (y * image.stride + rect.x0);
      const std::uint8_t* mask = image.mask + y * image.stride + rect.x0;
      for (int x = 0; x < 3 * width; ++x) colour[x] += from[x];
      for (int x = 0; x < width; ++x) covered[x] += static_cast<float>(mask[x]);
    }
    float* cells = out.cells + 4 * static_cast<std::int64_t>(row - first_row) * out.columns;
    for (int x = 0, column = (x0 + rect.x0) / f; x < width; ++column) {
      const int next = (column + 1) * f - x0 - rect.x0, end = next < width ? next : width;
      float* cell = cells + 4 * (column - first_column);
      for (; x < end; ++x) {
        for (int c = 0; c < 3; ++c) cell[c] += colour[3 * x + c];
        cell[3] += covered[x];
      }
    }
  }
}

void shade_tile_backward(const ShadeView& view, const float* upstream, int x0, int y0, const std::int32_t* fragments,
                         std::int32_t count, TileGradient& out) {
  (void)x0;
  (void)y0;
  out.num_faces = out.num_texels = 0;
  LightSums light_sums;
  for (Float& sum : light_sums.sum) sum = zero();
  const int width = view.raster->width;
  constexpr int kAhead = 4;
  const auto record = [&](std::int32_t i) { return fragments + static_cast<std::int64_t>(i) * kFragmentWords; };
  Fragment f, next;
  TexturePosition position, next_position;
  const auto load_one = [&](std::int32_t i, Fragment& to, TexturePosition& its_position) {
    to = load_fragment(record(i), view.texture != nullptr);
    look_ahead(view, to, its_position);
  };
  if (count > 0) load_one(0, f, position);
  for (std::int32_t i = 0; i < count; ++i) {
    if (i + kAhead < count) prefetch_upstream(upstream, width, record(i + kAhead));
    if (i + 1 < count) load_one(i + 1, next, next_position);
    Float g[3];
    load_pixels(upstream + 3 * (static_cast<std::int64_t>(f.y) * width + f.x), width - f.x, g);
    for (Float& value : g) value = f.face >= 0 ? value : zero();
    backward_pixels(view, f, position, g, out, light_sums);
    f = next;
    position = next_position;
  }
  for (std::int32_t i = 0; i < out.num_faces; ++i) {
    if (!view.normals && view.texture) sums_over_barycentrics(view, out.faces[i]);
    finish_face(view, out.faces[i]);
  }
  if (!out.lighting) return;
  for (int j = 0; j < 27; ++j) {
    double sum = 0;
    for (int lane = 0; lane < kLanes; ++lane) sum += static_cast<double>(light_sums.sum[j][lane]);
    out.lighting[j] = sum;
  }
}

void target_tile_backward(const TargetView& view, const float* upstream, int x0, int y0, const std::int32_t* fragments,
                          std::int32_t count, TileGradient& out) {
  (void)x0;
  (void)y0;
  out.num_faces = out.num_texels = 0;
  const float* m = view.raster->matrix;
  for (std::int32_t i = 0; i < count; ++i) {
    const Fragment f = load_fragment(fragments + static_cast<std::int64_t>(i) * kFragmentWords, false);
    Float du, dv;
    target_gradients(view, f, upstream, du, dv);
    // u = (row 0 . x) / w: du/dx = (row 0 - u row 2) / w
    const Float u = to_float(lane_numbers()) + (static_cast<float>(f.x) + 0.5f);
    const float v = static_cast<float>(f.y) + 0.5f;
    const Float inverse = 1.0f / f.z;
    Float values[6] = {zero(), zero(), zero(), zero(), zero(), zero()};
    for (int d = 0; d < 3; ++d) {
      values[d] = (du * (m[d] - u * m[8 + d]) + dv * (m[4 + d] - v * m[8 + d])) * inverse;
    }
    add_to_faces<false>(*view.raster, f, values, out);
  }
}

void face_normals(const NormalMesh& mesh, std::int64_t begin, std::int64_t end, float* normals) {
  for (std::int64_t f = begin; f < end; ++f) {
    const std::int32_t* face = mesh.faces + 4 * f;
    const float* a = mesh.vertices + 3 * static_cast<std::int64_t>(face[0]);
    const float* b = mesh.vertices + 3 * static_cast<std::int64_t>(face[1]);
    const float* c = mesh.vertices + 3 * static_cast<std::int64_t>(face[2]);
    const float p[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, q[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    cross(p, q, normals + 4 * f);
    normals[4 * f + 3] = 0;
  }
}

void sum_normals(const NormalMesh& mesh, const float* face_normals, std::int64_t begin, std::int64_t end,
                 float* normals) {
  for (std::int64_t i = begin; i < end; ++i) {
    Float4 sum = {0, 0, 0, 0};
    for (std::int32_t k = mesh.offsets[i]; k < mesh.offsets[i + 1]; ++k) {
      sum += load<Float4>(face_normals + 4 * static_cast<std::int64_t>(mesh.incident[k]));
    }
    store(normals + 4 * i, sum);
  }
}

void add_face_gradients(const FaceGradient* faces, std::int64_t count, std::int64_t begin, std::int64_t end,
                        float* sums) {
  for (std::int64_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) {
      const std::int64_t vertex = faces[i].corner[k];
      if (vertex < begin || vertex >= end) continue;
      float* sum = sums + 8 * vertex;
      store(sum, load<Float4>(sum) + load<Float4>(faces[i].sum[k]));
      store(sum + 4, load<Float4>(sum + 4) + load<Float4>(faces[i].sum[k] + 4));
    }
  }
}

void face_normal_gradients(const NormalMesh& mesh, const float* sums, std::int64_t begin, std::int64_t end,
                           float* out) {
  for (std::int64_t f = begin; f < end; ++f) {
    const std::int32_t* face = mesh.faces + 4 * f;
    Float4 g = {0, 0, 0, 0};
    // A face with a repeated vertex has no area for any position of the vertex.
    if (face[0] != face[1] && face[1] != face[2] && face[2] != face[0]) {
      for (int k = 0; k < 3; ++k) g += load<Float4>(sums + 8 * static_cast<std::int64_t>(face[k]) + 4);
    }
    store(out + 4 * f, g);
  }
}

void vertex_gradients(const NormalMesh& mesh, const float* sums, const float* face_gradients, std::int64_t begin,
                      std::int64_t end, float* out) {
  for (std::int64_t i = begin; i < end; ++i) {
    float g[3] = {sums[8 * i], sums[8 * i + 1], sums[8 * i + 2]};
    for (std::int32_t k = mesh.offsets[i]; face_gradients && k < mesh.offsets[i + 1]; ++k) {
      const std::int64_t f = mesh.incident[k];
      const float* to_normal = face_gradients + 4 * f;
      if (to_normal[0] == 0 && to_normal[1] == 0 && to_normal[2] == 0) continue;
      const std::int32_t* face = mesh.faces + 4 * f;
      const int at = face[0] == i ? 0 : face[1] == i ? 1 : 2;
      const float* next = mesh.vertices + 3 * static_cast<std::int64_t>(face[(at + 1) % 3]);
      const float* previous = mesh.vertices + 3 * static_cast<std::int64_t>(face[(at + 2) % 3]);
      const float edge[3] = {next[0] - previous[0], next[1] - previous[1], next[2] - previous[2]};
      float change[3];
      cross(edge, to_normal, change);
      for (int d = 0; d < 3; ++d) g[d] += change[d];
    }
    std::memcpy(out + 3 * i, g, sizeof g);
  }
}

void add_texel_gradients(const TexelGradient* texels, std::int64_t count, int width, int begin, int end,
                         float* texture) {
  for (std::int64_t i = 0; i < count; ++i) {
    const TexelGradient& t = texels[i];
    const int y = t.texel / width;
    if (y + 1 < begin || y >= end) continue;
    const float fx[2] = {1 - t.fx, t.fx}, fy[2] = {1 - t.fy, t.fy};
    for (int j = 0; j < 2; ++j) {
      if (y + j < begin || y + j >= end) continue;
      float* row = texture + 3 * (static_cast<std::int64_t>(t.texel) + static_cast<std::int64_t>(j) * width);
      for (int k = 0; k < 2; ++k) {
        for (int c = 0; c < 3; ++c) row[3 * k + c] += fx[k] * fy[j] * t.gradient[c];
      }
    }
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
