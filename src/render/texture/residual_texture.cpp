#include "doppel/render/texture/residual_texture.h"

#include <ATen/Parallel.h>
#include <torch/library.h>

#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/render/lighting/sh_lighting.h"
#include "doppel/render/raster/face_table.h"
#include "doppel/render/texture/residual_texture_kernel.h"

namespace doppel {
namespace {

using torch::Tensor;

/// Maps [B,3,T,T] whose three channels lie one after the other.
Tensor whole_maps(const Tensor& maps) { return maps.select(0, 0).is_contiguous() ? maps : maps.contiguous(); }

Tensor residual_texture_cpu(const Tensor& residual_in, const Tensor& albedo_in, const OptionalTensor& normals_in,
                            const OptionalTensor& lighting_in) {
  const bool lit = lighting_in.has_value();
  const std::int64_t B = residual_in.size(0), T = residual_in.size(2);
  check_floats("residual_texture", "residual", residual_in, {-1, 3, T, T});
  check_floats("residual_texture", "albedo", albedo_in, {1, 3, T, T});
  const Tensor texture = at::empty({B, T, T, 3}, residual_in.options());
  if (B == 0) return texture;
  const Tensor residual = whole_maps(residual_in), albedo = whole_maps(albedo_in);
  Tensor normals, lighting;
  kernels::ResidualTextureParams p{};
  p.albedo = albedo.data_ptr<float>();
  p.map_size = T * T;
  if (lit) {
    check_floats("residual_texture", "normals", *normals_in, {B, 3, T, T});
    check_floats("residual_texture", "lighting", *lighting_in, {3, kShBasis});
    normals = whole_maps(*normals_in);
    lighting = lighting_in->contiguous();
    p.lighting = lighting.data_ptr<float>();
  }
  for (std::int64_t b = 0; b < B; ++b) {
    p.residual = residual.data_ptr<float>() + b * residual.stride(0);
    if (lit) p.normals = normals.data_ptr<float>() + b * normals.stride(0);
    p.texture = texture.data_ptr<float>() + 3 * b * p.map_size;
    constexpr std::int64_t kTexelsPerThread = 8192;  // fewer do not pay for another thread
    at::parallel_for(0, p.map_size, kTexelsPerThread,
                     [&](std::int64_t begin, std::int64_t end) { kernels::residual_texture(p, begin, end); });
  }
  return texture;
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def("residual_texture(Tensor residual, Tensor albedo, Tensor? normals, Tensor? lighting) -> Tensor");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) { m.impl("residual_texture", TORCH_FN(residual_texture_cpu)); }

}  // namespace

Tensor residual_texture(const Tensor& residual, const Tensor& albedo, const Tensor& normals, const Tensor& lighting) {
  static const auto op = find_op<decltype(residual_texture_cpu)>("doppel::residual_texture");
  return op.call(residual, albedo, optional_of(normals), optional_of(lighting));
}

namespace {

/// L(n) of residual_texture, [B,3,T,T].
Tensor light_of(const Tensor& normals, const Tensor& lighting) {
  const torch::NoGradGuard no_grad;
  return sh_basis(normals.permute({0, 2, 3, 1})).matmul(lighting.t()).permute({0, 3, 1, 2});
}

/// Colours clamped to 0..1 with the gradient of the colours themselves. @param sum [B,3,T,T] @return [B,T,T,3]
Tensor clamped(const Tensor& sum) {
  const Tensor texture = sum + (sum.clamp(0.0, 1.0) - sum).detach();
  return texture.permute({0, 2, 3, 1}).contiguous();
}

/// [B,C,T,T] enlarged to T' texels along a side, bilinearly.
Tensor enlarged(const Tensor& maps, std::int64_t size) {
  return at::upsample_bilinear2d(maps, {size, size}, /*align_corners=*/false);
}

/// U(L(n)), [B,3,T',T']
Tensor enlarged_light(const Tensor& normals, const Tensor& lighting, std::int64_t size) {
  const torch::NoGradGuard no_grad;
  constexpr double kMinInside = 1e-3;  // of the four texels around one
  const Tensor inside = (normals * normals).sum(1, true).gt(0.25).to(normals.scalar_type());
  const Tensor light = light_of(normals, lighting) * inside;
  return enlarged(light, size) / enlarged(inside, size).clamp_min(kMinInside);
}

}  // namespace

Tensor residual_texture_reference(const Tensor& residual, const Tensor& albedo, const Tensor& normals,
                                  const Tensor& lighting) {
  const Tensor base = lighting.defined() ? albedo * light_of(normals, lighting) : albedo;
  return clamped(base + at::tanh(residual));
}

Tensor detailed_texture(const Tensor& residual, const Tensor& albedo, const Tensor& normals, const Tensor& lighting) {
  const std::int64_t size = albedo.size(-1);
  const Tensor base = lighting.defined() ? albedo * enlarged_light(normals, lighting, size) : albedo;
  return clamped(base + enlarged(at::tanh(residual), size));
}

}  // namespace doppel
