#include "doppel/render/texture/residual_texture_kernel.h"

#include "doppel/core/exponential.h"
#include "doppel/render/lighting/sh_lanes.h"
#include "doppel/render/simd.h"

namespace doppel::kernels::DOPPEL_ISA {
namespace {

/// tanh |x| = (1 - e) / (1 + e) with e = exp(-2 |x|). The error is about 1e-7, which no 8-bit colour shows.
inline Float hyperbolic_tangent(Float x) {
  const Float size = x < 0 ? -x : x;
  const Float e = exp_of_negative<Float, Int>(-2.0f * size);
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
