#include "doppel/render/residual_texture_kernel.h"

#include "doppel/render/sh_lanes.h"
#include "doppel/render/simd.h"

namespace doppel::kernels::DOPPEL_ISA {
namespace {

/// e^x for -87 <= x <= 0, to about 1e-7: 2^n times a polynomial on [-ln2/2, ln2/2] (Cephes expf).
inline Float exp_of_negative(Float x) {
  const Int n = round_to_int(x * 1.44269504f);
  const Float whole = to_float(n);
  const Float r = (x - whole * 0.693359375f) + whole * 2.12194440e-4f;
  Float e = r * 1.9875691500e-4f + 1.3981999507e-3f;
  e = e * r + 8.3334519073e-3f;
  e = e * r + 4.1665795894e-2f;
  e = e * r + 1.6666665459e-1f;
  e = e * r + 5.0000001201e-1f;
  e = e * (r * r) + r + 1.0f;
  return e * (Float)((n + 127) << 23);
}

/// tanh |x| = (1 - e) / (1 + e) with e = exp(-2 |x|). Differences of a small |x| are below 1e-7, which no 8-bit colour
/// shows.
inline Float hyperbolic_tangent(Float x) {
  const Float size = x < 0 ? -x : x;
  const Float e = exp_of_negative(max(-2.0f * size, splat(-80.0f)));
  const Float t = (1.0f - e) / (1.0f + e);
  return x < 0 ? -t : t;
}

inline void load_maps(const float* maps, std::int64_t map_size, std::int64_t at, int count, Float* out) {
  for (int d = 0; d < 3; ++d) {
    out[d] = Float{};
    std::memcpy(&out[d], maps + d * map_size + at, static_cast<std::size_t>(count) * sizeof(float));
  }
}

}  // namespace

void residual_texture(const ResidualTextureParams& p, std::int64_t begin, std::int64_t end) {
  for (std::int64_t i = begin; i < end; i += kLanes) {
    const int count = static_cast<int>(end - i < kLanes ? end - i : kLanes);
    Float residual[3], colour[3], light[3], normal[3], sh[9];
    load_maps(p.residual, p.map_size, i, count, residual);
    load_maps(p.albedo, p.map_size, i, count, colour);
    if (p.lighting) {
      load_maps(p.normals, p.map_size, i, count, normal);
      basis(normal, sh);
      illuminate(p.lighting, sh, light);
      for (int d = 0; d < 3; ++d) colour[d] *= light[d];
    }
    for (int d = 0; d < 3; ++d) colour[d] = min(max(colour[d] + hyperbolic_tangent(residual[d]), Float{}), splat(1.0f));
    float pixels[3 * kLanes];
    store_interleaved(pixels, colour);
    std::memcpy(p.texture + 3 * i, pixels, 3 * static_cast<std::size_t>(count) * sizeof(float));
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
