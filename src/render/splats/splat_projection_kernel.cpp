#include "doppel/core/exponential.h"
#include "doppel/render/splats/splat_kernel.h"
#include "doppel/render/splats/splat_lanes.h"

namespace doppel::kernels::DOPPEL_ISA {
namespace {

constexpr float kBlur = static_cast<float>(kSplatBlur);
constexpr float kLn2 = 0.693147181f;
constexpr float kHalfLog2e = 0.721347520f;
constexpr float kLog255 = static_cast<float>(kLog2Of255);
constexpr float kOutside = static_cast<float>(kOutsideImage);
constexpr float kMaxPixel = static_cast<float>(kMaxSplatPixel);
constexpr float kMinLength = static_cast<float>(kMinQuaternion), kMaxLength = static_cast<float>(kMaxQuaternion);
// Beyond these, products overflow float32: square metres, square pixels, and their squares.
constexpr float kMaxSquare = 1e30f, kMaxVariance = 1e15f, kMaxDeterminant = 1e30f;

/// The parameters of eight Gaussians, one after the other; those of fewer are followed by zeros.
struct Block {
  const float *positions, *rotations, *log_scales, *opacities, *normals;
  const float* harmonics;  ///< null if there are more than one
  float copy[17 * kEight];

  Block(const SplatArrays& in, int count, std::int64_t n, int here) {
    float* next = copy;
    const auto rows = [&](const float* all, int columns) -> const float* {
      if (!all) return nullptr;
      if (here == kEight) return all + columns * n;
      float* const out = next;
      next += columns * kEight;
      std::memset(out, 0, sizeof(float) * static_cast<std::size_t>(columns * kEight));
      std::memcpy(out, all + columns * n, sizeof(float) * static_cast<std::size_t>(columns * here));
      return out;
    };
    positions = rows(in.positions, 3);
    rotations = rows(in.rotations, 4);
    log_scales = rows(in.log_scales, 3);
    opacities = rows(in.opacities, 1);
    normals = rows(in.normals, 3);
    harmonics = rows(count == 1 ? in.harmonics : nullptr, 3);
  }
};

/// Eight Gaussians and what the projection makes of them.
struct Projected {
  Float8 offset[3];      ///< position - centre of the camera
  Float8 quaternion[4];  ///< as given
  Float8 length;         ///< of it
  Float8 rotation[3][3];
  Float8 scale[3];
  Float8 axes[3][3];  ///< rotation * diag(scale)
  Float8 depth;
  Double8 u, v;
  Int8 free_u, free_v;  ///< the centre is within the limits of J
  Float8 jacobian[2][3];
  Float8 along[2][3];  ///< jacobian * axes
  Float8 a11, a12, a22, determinant;
  Float8 opacity, hidden_part;  ///< and 1 - opacity
};

inline Float8 dot3(const Float8* a, const Float8* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline Float8 exp8(Float8 x) {
  const Float8 e = exp_of_negative<Float8, Int8>(x > 0.0f ? -x : x);
  return x > 0.0f ? 1.0f / e : e;
}

inline void find_axes(const Block& in, Projected& p) {
  load_rows4(in.rotations, p.quaternion);
  const Float8* q = p.quaternion;
  p.length = sqrt8(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const Float8 scale = 1.0f / p.length, w = q[0] * scale, x = q[1] * scale, y = q[2] * scale, z = q[3] * scale;
  p.rotation[0][0] = 1.0f - 2.0f * (y * y + z * z);
  p.rotation[0][1] = 2.0f * (x * y - w * z);
  p.rotation[0][2] = 2.0f * (x * z + w * y);
  p.rotation[1][0] = 2.0f * (x * y + w * z);
  p.rotation[1][1] = 1.0f - 2.0f * (x * x + z * z);
  p.rotation[1][2] = 2.0f * (y * z - w * x);
  p.rotation[2][0] = 2.0f * (x * z - w * y);
  p.rotation[2][1] = 2.0f * (y * z + w * x);
  p.rotation[2][2] = 1.0f - 2.0f * (x * x + y * y);
  load_rows3(in.log_scales, p.scale);
  for (int k = 0; k < 3; ++k) {
    p.scale[k] = exp8(p.scale[k]);
    for (int i = 0; i < 3; ++i) p.axes[i][k] = p.rotation[i][k] * p.scale[k];
  }
}

/// J, its rows of the limit where the centre is outside of it.
inline void find_jacobian(const SplatCamera& camera, Projected& p) {
  const double* m = camera.matrix;
  const Float8 inverse = 1.0f / p.depth;
  for (int row = 0; row < 2; ++row) {
    const Double8 at = row == 0 ? p.u : p.v;
    const float size = static_cast<float>(row == 0 ? camera.width : camera.height);
    const Float8 pixel = __builtin_convertvector(at, Float8);
    const Float8 limited = min8(max8(pixel, eight(-kOutside * size)), eight((1.0f + kOutside) * size));
    (row == 0 ? p.free_u : p.free_v) = pixel == limited;
    const Double8 used = __builtin_convertvector(limited, Double8);
    for (int d = 0; d < 3; ++d) {
      const Double8 numerator = m[4 * row + d] - used * m[8 + d];
      p.jacobian[row][d] = __builtin_convertvector(numerator, Float8) * inverse;
    }
  }
}

inline void project(const Block& in, const SplatCamera& camera, Projected& p) {
  const double* m = camera.matrix;
  Float8 position[3];
  load_rows3(in.positions, position);
  Double8 sum[3];
  for (int row = 0; row < 3; ++row) sum[row] = m[4 * row + 3] - Double8{};
  for (int d = 0; d < 3; ++d) {
    p.offset[d] = position[d] - camera.centre[d];
    const Double8 precise = __builtin_convertvector(position[d], Double8);
    for (int row = 0; row < 3; ++row) sum[row] += m[4 * row + d] * precise;
  }
  const Double8 inverse = 1.0 / sum[2];
  p.u = sum[0] * inverse;
  p.v = sum[1] * inverse;
  p.depth = __builtin_convertvector(sum[2], Float8);
  find_axes(in, p);
  find_jacobian(camera, p);
  for (int row = 0; row < 2; ++row) {
    for (int k = 0; k < 3; ++k) {
      const Float8 axis[3] = {p.axes[0][k], p.axes[1][k], p.axes[2][k]};
      p.along[row][k] = dot3(p.jacobian[row], axis);
    }
  }
  const Float8 *a0 = p.along[0], *a1 = p.along[1];
  const Float8 square0 = dot3(a0, a0), square1 = dot3(a1, a1);
  const Float8 cross[3] = {a0[1] * a1[2] - a0[2] * a1[1], a0[2] * a1[0] - a0[0] * a1[2], a0[0] * a1[1] - a0[1] * a1[0]};
  p.a11 = square0 + kBlur;
  p.a12 = dot3(a0, a1);
  p.a22 = square1 + kBlur;
  // |a0 x a1|^2 instead of a difference of products, which thin Gaussians would lose to rounding.
  p.determinant = dot3(cross, cross) + kBlur * (square0 + square1) + kBlur * kBlur;
  const Float8 logit = load8(in.opacities);
  const Float8 e = exp_of_negative<Float8, Int8>(logit > 0.0f ? -logit : logit), more = 1.0f / (1.0f + e);
  p.opacity = logit > 0.0f ? more : e * more;
  p.hidden_part = logit > 0.0f ? e * more : more;
}

// --- colour ----------------------------------------------------------------------------------------------------------

constexpr float kC0 = 0.282094792f, kC1 = 0.488602512f;
constexpr float kC2[5] = {1.09254843f, -1.09254843f, 0.315391565f, -1.09254843f, 0.546274215f};
constexpr float kC3[7] = {-0.590043590f, 2.89061144f, -0.457045799f, 0.373176333f,
                          -0.457045799f, 1.44530572f, -0.590043590f};

/// Y of the unit vector d; `count` of them.
inline void harmonics(const Float8* d, int count, Float8* out) {
  const Float8 x = d[0], y = d[1], z = d[2];
  out[0] = eight(kC0);
  if (count == 1) return;
  out[1] = -kC1 * y;
  out[2] = kC1 * z;
  out[3] = -kC1 * x;
  if (count == 4) return;
  const Float8 xx = x * x, yy = y * y, zz = z * z;
  out[4] = kC2[0] * x * y;
  out[5] = kC2[1] * y * z;
  out[6] = kC2[2] * (2.0f * zz - xx - yy);
  out[7] = kC2[3] * x * z;
  out[8] = kC2[4] * (xx - yy);
  if (count == 9) return;
  out[9] = kC3[0] * y * (3.0f * xx - yy);
  out[10] = kC3[1] * x * y * z;
  out[11] = kC3[2] * y * (4.0f * zz - xx - yy);
  out[12] = kC3[3] * z * (2.0f * zz - 3.0f * xx - 3.0f * yy);
  out[13] = kC3[4] * x * (4.0f * zz - xx - yy);
  out[14] = kC3[5] * z * (xx - yy);
  out[15] = kC3[6] * x * (xx - 3.0f * yy);
}

/// Gradient to d of sum_k t[k] Y_k(d), as if the polynomials held beyond unit vectors.
inline void harmonics_gradient(const Float8* d, int count, const Float8* t, Float8* out) {
  const Float8 x = d[0], y = d[1], z = d[2];
  out[0] = -kC1 * t[3];
  out[1] = -kC1 * t[1];
  out[2] = kC1 * t[2];
  if (count == 4) return;
  out[0] += kC2[0] * y * t[4] - 2.0f * kC2[2] * x * t[6] + kC2[3] * z * t[7] + 2.0f * kC2[4] * x * t[8];
  out[1] += kC2[0] * x * t[4] + kC2[1] * z * t[5] - 2.0f * kC2[2] * y * t[6] - 2.0f * kC2[4] * y * t[8];
  out[2] += kC2[1] * y * t[5] + 4.0f * kC2[2] * z * t[6] + kC2[3] * x * t[7];
  if (count == 9) return;
  const Float8 xx = x * x, yy = y * y, zz = z * z, xy = x * y, xz = x * z, yz = y * z;
  out[0] += 6.0f * kC3[0] * xy * t[9] + kC3[1] * yz * t[10] - 2.0f * kC3[2] * xy * t[11] - 6.0f * kC3[3] * xz * t[12] +
            kC3[4] * (4.0f * zz - 3.0f * xx - yy) * t[13] + 2.0f * kC3[5] * xz * t[14] +
            3.0f * kC3[6] * (xx - yy) * t[15];
  out[1] += 3.0f * kC3[0] * (xx - yy) * t[9] + kC3[1] * xz * t[10] + kC3[2] * (4.0f * zz - xx - 3.0f * yy) * t[11] -
            6.0f * kC3[3] * yz * t[12] - 2.0f * kC3[4] * xy * t[13] - 2.0f * kC3[5] * yz * t[14] -
            6.0f * kC3[6] * xy * t[15];
  out[2] += kC3[1] * xy * t[10] + 8.0f * kC3[2] * yz * t[11] + kC3[3] * (6.0f * zz - 3.0f * xx - 3.0f * yy) * t[12] +
            8.0f * kC3[4] * xz * t[13] + kC3[5] * (xx - yy) * t[14];
}

/// Colours and harmonics of eight Gaussians.
struct Shade {
  Float8 direction[3], distance;
  alignas(32) float basis[kMaxHarmonics][kEight];
  Float8 colour[3];  ///< before the limit at 0
};

/// @param rows [here,count,3]
inline void shade(const Block& block, const float* rows, int count, int here, const Float8* offset, Shade& out) {
  if (count == 1) {
    Float8 only[3];
    load_rows3(block.harmonics, only);
    for (int c = 0; c < 3; ++c) out.colour[c] = kC0 * only[c] + 0.5f;
    return;
  }
  out.distance = sqrt8(dot3(offset, offset));
  for (int d = 0; d < 3; ++d) out.direction[d] = offset[d] / out.distance;
  Float8 basis[kMaxHarmonics];
  harmonics(out.direction, count, basis);
  std::memcpy(out.basis, basis, static_cast<std::size_t>(count) * sizeof(Float8));
  float colour[3][kEight] = {};
  for (int i = 0; i < here; ++i) {
    const float* h = rows + 3 * count * i;
    float sum[3] = {0.5f, 0.5f, 0.5f};
    for (int k = 0; k < count; ++k) {
      for (int c = 0; c < 3; ++c) sum[c] += out.basis[k][i] * h[3 * k + c];
    }
    for (int c = 0; c < 3; ++c) colour[c][i] = sum[c];
  }
  for (int c = 0; c < 3; ++c) out.colour[c] = load8(colour[c]);
}

// --- records ---------------------------------------------------------------------------------------------------------

/// The screen factors a, b, c of a record: e = log_opacity - (a dx + b dy)^2 - (c dy)^2.
struct Factors {
  Float8 a, b, c;
};
inline Factors factors(const Projected& p) {
  Factors f;
  f.a = sqrt8(kHalfLog2e * p.a22 / p.determinant);
  f.b = -f.a * (p.a12 / p.a22);
  f.c = sqrt8(kHalfLog2e / p.a22);
  return f;
}

inline Float8 floor_of(Double8 x) {  // of |x| < 2^31
  const Float8 near = __builtin_convertvector(__builtin_convertvector(x, Int8), Float8);
  return near - where8((Int8)(near > __builtin_convertvector(x, Float8)), eight(1.0f));
}

/// First and last pixel of a centre and an extent, with a margin of .05 that is wider than that of the rows, within 0
/// and `size` - 1; empty if last < first.
inline void pixel_range(Float8 centre, Float8 extent, int size, Int8& first, Int8& last) {
  const auto most = static_cast<float>(size);
  first = __builtin_convertvector(min8(max8(centre - extent + 0.45f, Float8{}), eight(most)), Int8);
  last = __builtin_convertvector(min8(max8(centre + extent + 0.55f, Float8{}), eight(most)), Int8) - 1;
}

/// What a record holds besides the projection.
struct Extent {
  Float8 log_opacity, square;  ///< in powers of two; of the distance from the camera
  Int8 x0, x1, y0, y1;
};
inline Extent extent_of(const Projected& p, const SplatCamera& camera) {
  Extent e;
  e.log_opacity = log2_8(max8(p.opacity, eight(1e-30f)));
  e.square = dot3(p.offset, p.offset);
  const Float8 reach = max8(e.log_opacity + kLog255, Float8{}) * (2.0f * kLn2);
  pixel_range(__builtin_convertvector(p.u, Float8), sqrt8(reach * p.a11), camera.width, e.x0, e.x1);
  pixel_range(__builtin_convertvector(p.v, Float8), sqrt8(reach * p.a22), camera.height, e.y0, e.y1);
  return e;
}

/// The Gaussians to draw. NaN and infinity fail the comparisons.
inline Int8 find_visible(const Block& block, const Projected& p, const Extent& e, const SplatCamera& camera) {
  Float8 logs[3];
  load_rows3(block.log_scales, logs);
  const Float8 sizes = dot3(logs, logs) + load8(block.opacities);
  const Float8 u = __builtin_convertvector(p.u, Float8), v = __builtin_convertvector(p.v, Float8);
  Int8 visible = (e.log_opacity + kLog255 >= 0.0f) & (p.depth >= camera.z_near) & (e.square < kMaxSquare);
  visible &= (u < kMaxPixel) & (u > -kMaxPixel) & (v < kMaxPixel) & (v > -kMaxPixel);
  visible &= (p.a11 < kMaxVariance) & (p.a22 < kMaxVariance) & (p.determinant < kMaxDeterminant);
  visible &= (e.x1 >= e.x0) & (e.y1 >= e.y0) & (p.length > kMinLength) & (p.length < kMaxLength);
  visible &= (sizes < kMaxSquare) & (sizes > -kMaxSquare);
  if (block.normals) {
    Float8 normal[3];
    load_rows3(block.normals, normal);
    visible &= dot3(p.offset, normal) <= 0.0f;
  }
  return visible;
}

/// Writes the records. Gaussians that are not visible, or whose colours are not finite, are hidden.
inline void write_records(const Projected& p, const Extent& e, const Shade& shading, Int8 visible, int here,
                          SplatRecord* records) {
  const Factors f = factors(p);
  const Float8 pixel_x = floor_of(p.u), pixel_y = floor_of(p.v);
  const Float8 sum = shading.colour[0] + shading.colour[1] + shading.colour[2];
  visible &= sum * 0.0f == 0.0f;
  const auto of = [](Int8 v) { return (Float8)v; };  // moved, never computed with
  const Float8 low[kEight] = {of(__builtin_convertvector(pixel_x, Int8)),
                              of(__builtin_convertvector(pixel_y, Int8)),
                              __builtin_convertvector(p.u - __builtin_convertvector(pixel_x, Double8), Float8),
                              __builtin_convertvector(p.v - __builtin_convertvector(pixel_y, Double8), Float8),
                              f.a,
                              f.b,
                              f.c,
                              e.log_opacity};
  const Float8 high[kEight] = {max8(shading.colour[0], Float8{}),         max8(shading.colour[1], Float8{}),
                               max8(shading.colour[2], Float8{}),         p.depth,
                               of((e.x0 & 0xffff) | (e.x1 << 16)),        of((e.y0 & 0xffff) | (e.y1 << 16)),
                               of(((Int8)e.square & visible) | ~visible), 1.0f / f.a};
  static_assert(kHiddenSplat == 0xffffffffu && sizeof(SplatRecord) == 2 * sizeof(Float8));
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "x0 and y0 are the low halves");
  Float8 first[kEight], second[kEight];
  transpose8(low, first);
  transpose8(high, second);
  for (int i = 0; i < here; ++i) {
    std::memcpy(records + i, first + i, sizeof first[i]);
    std::memcpy(reinterpret_cast<char*>(records + i) + sizeof first[i], second + i, sizeof second[i]);
  }
}

}  // namespace

void project_splats(const SplatArrays& splats, const SplatCamera& camera, std::int64_t begin, std::int64_t end,
                    SplatRecord* records) {
  for (std::int64_t n = begin; n < end; n += kEight) {
    const int here = static_cast<int>(end - n < kEight ? end - n : kEight);
    const Block block(splats, camera.harmonics, n, here);
    Projected p;
    project(block, camera, p);
    const Extent extent = extent_of(p, camera);
    const Int8 visible = find_visible(block, p, extent, camera);
    if (bits8(visible) == 0) {
      for (int i = 0; i < here; ++i) records[n + i].key = kHiddenSplat;
      continue;
    }
    Shade shading;
    shade(block, splats.harmonics + 3 * camera.harmonics * n, camera.harmonics, here, p.offset, shading);
    write_records(p, extent, shading, visible, here, records + n);
  }
}

// --- backward --------------------------------------------------------------------------------------------------------

namespace {

/// The sums of eight records over their tiles.
struct Total {
  Float8 g, gs, gr, gss, gsr, grr, colour[3], depth;
};

inline Total total_of(const SplatSums* sums, const SplatSlots& at, std::int64_t n, int here) {
  Float8 low[kEight] = {}, high[kEight] = {}, part[kEight];
  for (int i = 0; i < here; ++i) {
    for (std::int32_t copy = at.first[n + i]; copy < at.first[n + i + 1]; ++copy) {
      Float8 row[2];
      std::memcpy(row, &sums[at.slots[copy]], sizeof row);
      low[i] += row[0];
      high[i] += row[1];
    }
  }
  transpose8(low, part);
  Total t{part[0], part[1], part[2], part[3], part[4], part[5], {part[6], part[7], {}}, {}};
  for (int i = 0; i < kEight; ++i) {
    t.colour[2][i] = high[i][0];
    t.depth[i] = high[i][1];
  }
  return t;
}

/// Asks for the sums of the next eight Gaussians, which lie anywhere in memory. GCC drops calls of a function that only
/// prefetches, unless it must inline it.
__attribute__((always_inline)) inline void fetch_sums(const SplatSums* sums, const SplatSlots& at, std::int64_t n,
                                                      std::int64_t end) {
  const std::int64_t last = end < n + kEight ? end : n + kEight;
  if (n >= last) return;
  for (std::int32_t copy = at.first[n]; copy < at.first[last]; ++copy) __builtin_prefetch(sums + at.slots[copy]);
}

struct ProjectedGradient {
  Float8 position[3], quaternion[4], log_scale[3];
};

/// Gradient through the covariance: to J and to the axes.
inline void covariance_gradient(const Projected& p, const Total& t, Float8 (*to_jacobian)[3], Float8 (*to_axes)[3]) {
  const Factors f = factors(p);
  constexpr float kScale = 4.0f * kLn2 * kLn2;
  // dL/dA = 4 ln2^2 W^T M (W A), W = [[a, b], [0, c]], M the moments of s and r
  Float8 to_along[2][3];
  for (int k = 0; k < 3; ++k) {
    const Float8 s = f.a * p.along[0][k] + f.b * p.along[1][k], r = f.c * p.along[1][k];
    const Float8 ms = kScale * (t.gss * s + t.gsr * r), mr = kScale * (t.gsr * s + t.grr * r);
    to_along[0][k] = f.a * ms;
    to_along[1][k] = f.b * ms + f.c * mr;
  }
  for (int d = 0; d < 3; ++d) {
    for (int row = 0; row < 2; ++row) to_jacobian[row][d] = dot3(to_along[row], p.axes[d]);
    for (int k = 0; k < 3; ++k) {
      to_axes[d][k] = p.jacobian[0][d] * to_along[0][k] + p.jacobian[1][d] * to_along[1][k];
    }
  }
}

/// Gradient of the axes to the logarithms of the scales and to the quaternion as given.
inline void axes_gradient(const Projected& p, Float8 (*to_axes)[3], ProjectedGradient& out) {
  Float8 r[3][3];  // to the rotation
  for (int k = 0; k < 3; ++k) {
    out.log_scale[k] = Float8{};
    for (int i = 0; i < 3; ++i) {
      out.log_scale[k] += to_axes[i][k] * p.axes[i][k];
      r[i][k] = to_axes[i][k] * p.scale[k];
    }
  }
  Float8 unit[4], g[4];
  const Float8 inverse = 1.0f / p.length;
  for (int d = 0; d < 4; ++d) unit[d] = p.quaternion[d] * inverse;
  const Float8 w = unit[0], x = unit[1], y = unit[2], z = unit[3];
  g[0] = 2.0f * (x * (r[2][1] - r[1][2]) + y * (r[0][2] - r[2][0]) + z * (r[1][0] - r[0][1]));
  g[1] = 2.0f *
         (y * (r[0][1] + r[1][0]) + z * (r[0][2] + r[2][0]) + w * (r[2][1] - r[1][2]) - 2.0f * x * (r[1][1] + r[2][2]));
  g[2] = 2.0f *
         (x * (r[0][1] + r[1][0]) + z * (r[1][2] + r[2][1]) + w * (r[0][2] - r[2][0]) - 2.0f * y * (r[0][0] + r[2][2]));
  g[3] = 2.0f *
         (x * (r[0][2] + r[2][0]) + y * (r[1][2] + r[2][1]) + w * (r[1][0] - r[0][1]) - 2.0f * z * (r[0][0] + r[1][1]));
  const Float8 radial = g[0] * w + g[1] * x + g[2] * y + g[3] * z;
  for (int d = 0; d < 4; ++d) out.quaternion[d] = (g[d] - unit[d] * radial) * inverse;
}

/// Gradient of centre, depth and J to the position.
inline void position_gradient(const SplatCamera& camera, const Projected& p, const Total& t, Float8 (*to_jacobian)[3],
                              ProjectedGradient& out) {
  const Factors f = factors(p);
  Float8 to_u = 2.0f * kLn2 * f.a * t.gs, to_v = 2.0f * kLn2 * (f.b * t.gs + f.c * t.gr), to_depth = t.depth;
  const Float8 inverse = 1.0f / p.depth;
  Float8 last[3];
  for (int d = 0; d < 3; ++d) last[d] = eight(static_cast<float>(camera.matrix[8 + d]));
  to_u -= where8(p.free_u, dot3(to_jacobian[0], last) * inverse);
  to_v -= where8(p.free_v, dot3(to_jacobian[1], last) * inverse);
  to_depth -= (dot3(to_jacobian[0], p.jacobian[0]) + dot3(to_jacobian[1], p.jacobian[1])) * inverse;
  const double* m = camera.matrix;
  for (int d = 0; d < 3; ++d) {
    const Float8 du = __builtin_convertvector(m[d] - p.u * m[8 + d], Float8) * inverse;
    const Float8 dv = __builtin_convertvector(m[4 + d] - p.v * m[8 + d], Float8) * inverse;
    out.position[d] = to_u * du + to_v * dv + to_depth * last[d];
  }
}

/// Gaussians whose gradients are added to memory.
struct Target {
  int here;
  Int8 drawn;                 ///< the others may hold NaN
  const std::int32_t* first;  ///< [here+1] of the slots

  Target(const std::int32_t* first_slot, int count) : here(count), drawn{}, first(first_slot) {
    for (int i = 0; i < here; ++i) drawn[i] = first[i] == first[i + 1] ? 0 : -1;
  }
};

/// Adds a vector for each of `kColumns` numbers to rows of them.
template <int kColumns>
inline void add_rows(const Float8* values, const Target& target, float* out) {
  Float8 v[kColumns];
  for (int d = 0; d < kColumns; ++d) v[d] = where8(target.drawn, values[d]);
  if (target.here == kEight) return add_to_rows<kColumns>(out, v);
  for (int i = 0; i < target.here; ++i) {
    for (int d = 0; d < kColumns; ++d) out[i * kColumns + d] += v[d][i];
  }
}

/// Adds the gradient of the colours to the harmonics, and to the position in `out`.
/// @param rows [here,count,3] @param to_rows as `rows`
inline void colour_gradient(const Block& block, const float* rows, int count, const Target& target, const Projected& p,
                            const Total& t, float* to_rows, ProjectedGradient& out) {
  Shade shading;
  shade(block, rows, count, target.here, p.offset, shading);
  Float8 g[3];
  for (int c = 0; c < 3; ++c) g[c] = where8(shading.colour[c] > 0.0f, t.colour[c]);
  if (count == 1) {
    for (Float8& x : g) x *= kC0;
    add_rows<3>(g, target, to_rows);
    return;
  }
  Float8 through[kMaxHarmonics] = {};  // sum_c gradient_c h_kc
  for (int i = 0; i < target.here; ++i) {
    if (target.first[i] == target.first[i + 1]) continue;
    for (int k = 0; k < count; ++k) {
      const int at = 3 * (count * i + k);
      through[k][i] = g[0][i] * rows[at] + g[1][i] * rows[at + 1] + g[2][i] * rows[at + 2];
      for (int c = 0; c < 3; ++c) to_rows[at + c] += shading.basis[k][i] * g[c][i];
    }
  }
  Float8 to_direction[3];
  harmonics_gradient(shading.direction, count, through, to_direction);
  const Float8 radial = dot3(to_direction, shading.direction);
  for (int d = 0; d < 3; ++d) {
    out.position[d] += (to_direction[d] - shading.direction[d] * radial) / shading.distance;
  }
}

}  // namespace

void project_splats_backward(const SplatArrays& splats, const SplatCamera& camera, const SplatSlots& at,
                             const SplatSums* sums, std::int64_t begin, std::int64_t end, const SplatGradients& out) {
  const int count = camera.harmonics;
  for (std::int64_t n = begin; n < end; n += kEight) {
    const int here = static_cast<int>(end - n < kEight ? end - n : kEight);
    const std::int32_t* first = at.first + n;
    if (first[0] == first[here]) continue;
    fetch_sums(sums, at, n + kEight, end);
    const Total total = total_of(sums, at, n, here);
    Projected p;
    const Block block(splats, count, n, here);
    const Target target(first, here);
    project(block, camera, p);
    ProjectedGradient gradient;
    Float8 to_jacobian[2][3], to_axes[3][3];
    covariance_gradient(p, total, to_jacobian, to_axes);
    axes_gradient(p, to_axes, gradient);
    position_gradient(camera, p, total, to_jacobian, gradient);
    colour_gradient(block, splats.harmonics + 3 * count * n, count, target, p, total, out.harmonics + 3 * count * n,
                    gradient);
    const Float8 to_logit = total.g * p.hidden_part;
    add_rows<3>(gradient.position, target, out.positions + 3 * n);
    add_rows<4>(gradient.quaternion, target, out.rotations + 4 * n);
    add_rows<3>(gradient.log_scale, target, out.log_scales + 3 * n);
    add_rows<1>(&to_logit, target, out.opacities + n);
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
