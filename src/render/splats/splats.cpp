#include "doppel/render/splats/splats.h"

#include <torch/csrc/jit/frontend/tracer.h>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/render/raster/face_table.h"
#include "doppel/render/shading/shading_terms.h"
#include "doppel/render/splats/splat_terms.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr const char* kOp = "draw_splats";

splats::Cameras cameras_of(const Tensor& projection) {
  const Tensor matrix = projection.detach().to(torch::kFloat64);
  const Tensor scale = matrix.select(2, 2).slice(2, 0, 3).norm(2, 2).view({matrix.size(0), matrix.size(1), 1, 1});
  return {matrix / torch::where(scale > 0, scale, torch::ones_like(scale)),
          shading::view_tensors(kOp, projection).centre};
}

}  // namespace

void check_splats(const char* op, const Splats& s) {
  const Tensor& p = s.positions;
  if (!p.defined() || !p.device().is_cpu() ||
      (p.scalar_type() != torch::kFloat32 && p.scalar_type() != torch::kFloat64)) {
    fail<UsageError>("{}: positions must be float32 or float64 [B,N,3] on the CPU, found {}", op, describe(p));
  }
  const auto check = [&](const char* name, const Tensor& t, torch::IntArrayRef shape, const char* letters) {
    check_shape(op, name, t, shape, letters);
    check_same_kind(op, name, t, p);
  };
  check("positions", p, {-1, -1, 3}, "[B,N,3]");
  const std::int64_t B = p.size(0), N = p.size(1);
  check("rotations", s.rotations, {B, N, 4}, "[B,N,4]");
  check("log_scales", s.log_scales, {B, N, 3}, "[B,N,3]");
  check("opacities", s.opacities, {B, N}, "[B,N]");
  check("harmonics", s.harmonics, {B, N, -1, 3}, "[B,N,S,3]");
  const std::int64_t S = s.harmonics.size(2);
  if (S != 1 && S != 4 && S != 9 && S != 16)
    fail<UsageError>("{}: found {} spherical harmonics per colour; 1, 4, 9 and 16 are allowed (degree 0 to 3)", op, S);
  if (s.normals.defined()) check("normals", s.normals, {B, N, 3}, "[B,N,3]");
}

SplatImage draw_splats(const Splats& splats, const Tensor& projection, std::int64_t height, std::int64_t width,
                       const SplatOptions& options) {
  check_splats(kOp, splats);
  check_shape(kOp, "projection", projection, {splats.positions.size(0), -1, 3, 4}, "[B,C,3,4]");
  check_same_kind(kOp, "projection", projection, splats.positions);
  if (height < 1 || width < 1 || height > kernels::kMaxImage || width > kernels::kMaxImage) {
    fail<UsageError>("{}: the image has {} x {} pixels; each side must have 1 to {}", kOp, width, height,
                     kernels::kMaxImage);
  }
  if (!(options.z_near > 0)) fail<UsageError>("{}: z_near is {} m; it must be greater than 0", kOp, options.z_near);
  const bool kernel =
      splats.positions.scalar_type() == torch::kFloat32 && !options.use_reference && !torch::jit::tracer::isTracing();
  const splats::Cameras cameras = cameras_of(projection);
  return kernel ? splats::fused(splats, cameras, height, width, options)
                : splats::reference(splats, cameras, height, width, options);
}

}  // namespace doppel
