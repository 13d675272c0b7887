#include "doppel/render/shading/shading.h"

#include <torch/csrc/jit/frontend/tracer.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/render/raster/face_table.h"
#include "doppel/render/shading/shading_terms.h"

namespace doppel {

using torch::Tensor;

namespace {

bool takes_kernel(const Tensor& vertices, bool use_reference) {
  return vertices.scalar_type() == torch::kFloat32 && !use_reference && !torch::jit::tracer::isTracing();
}

/// Fails unless `t` has the type and device of the vertices and the given sizes (-1: any).
void check(const char* op, const char* name, const Tensor& t, const Tensor& vertices, torch::IntArrayRef sizes,
           const char* letters) {
  check_shape(op, name, t, sizes, letters);
  check_same_kind(op, name, t, vertices);
}

void check_mesh(const char* op, const Tensor& vertices, const Tensor& projection, const RenderMesh& mesh,
                float z_near) {
  if (!vertices.defined() || !vertices.is_floating_point() || vertices.scalar_type() == torch::kFloat16) {
    fail<UsageError>("{}: vertices must be float32 or float64 [B,N,3], found {}", op, describe(vertices));
  }
  if (!vertices.device().is_cpu())
    fail<UsageError>("{}: vertices are on {}; they must be on the CPU", op, vertices.device().str());
  check(op, "vertices", vertices, vertices, {-1, mesh.num_vertices, 3}, "[B,N,3]");
  check(op, "projection", projection, vertices, {vertices.size(0), -1, 3, 4}, "[B,C,3,4]");
  if (!(z_near > 0)) fail<UsageError>("{}: z_near is {} m; it must be greater than 0", op, z_near);
}

void check_texture(const Tensor& texture, const Tensor& vertices, std::int64_t cameras, const RenderMesh& mesh) {
  const char* const op = "shade";
  check(op, "texture", texture, vertices, {-1, -1, -1, 3}, "[Bt,Th,Tw,3]");
  const std::int64_t batch = vertices.size(0), count = texture.size(0);
  if (count != 1 && count != batch && count != batch * cameras) {
    fail<UsageError>("{}: {} textures for a batch of {} with {} cameras; there must be 1, {} or {}", op, count, batch,
                     cameras, batch, batch * cameras);
  }
  if (texture.size(1) < 1 || texture.size(2) < 1 || texture.size(1) > kernels::kMaxImage ||
      texture.size(2) > kernels::kMaxImage) {
    fail<UsageError>("{}: the texture has {} x {} texels; each side must have 1 to {}", op, texture.size(2),
                     texture.size(1), kernels::kMaxImage);
  }
  if (!mesh.has_uvs()) {
    fail<UsageError>(
        "{}: the mesh has no UVs, so a texture of {} x {} texels cannot be placed on it; give the mesh "
        "`vt` coordinates, or draw without texture",
        op, texture.size(2), texture.size(1));
  }
}

void check_lighting(const Tensor& lighting, const Tensor& vertices, std::int64_t cameras) {
  if (!lighting.defined()) {
    fail<UsageError>("shade: no lighting; give coefficients [B,C,3,9], or set ShadingOptions::lit to false");
  }
  const bool shared = lighting.dim() == 4 && lighting.size(0) == 1;
  check("shade", "lighting", lighting, vertices, {shared ? 1 : vertices.size(0), cameras, 3, 9},
        "[B,C,3,9] or [1,C,3,9]");
}

}  // namespace

shading::ViewTensors shading::view_tensors(const char* op, const Tensor& projection) {
  const std::int64_t batch = projection.size(0), cameras = projection.size(1);
  ViewTensors out{torch::zeros({batch, cameras, 3, 3}, torch::kFloat64),
                  torch::zeros({batch, cameras, 3}, torch::kFloat64)};
  const Tensor matrices = projection.detach().to(torch::kFloat64).contiguous();
  const double* p = matrices.data_ptr<double>();
  double* ray = out.ray.data_ptr<double>();
  double* centre = out.centre.data_ptr<double>();
  for (std::int64_t i = 0; i < batch * cameras; ++i, p += 12, ray += 9, centre += 3) {
    if (std::all_of(p, p + 12, [](double x) { return x == 0; })) continue;
    const auto cofactor = [&](int r, int c) {
      const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
      return p[4 * r1 + c1] * p[4 * r2 + c2] - p[4 * r1 + c2] * p[4 * r2 + c1];
    };
    double determinant = 0, size = 1;
    for (int c = 0; c < 3; ++c) determinant += p[c] * cofactor(0, c);
    for (int r = 0; r < 3; ++r) size *= std::hypot(p[4 * r], p[4 * r + 1], p[4 * r + 2]);
    if (!(std::abs(determinant) > 1e-12 * size) || !std::isfinite(determinant)) {
      fail<UsageError>(
          "{}: the projection matrix of batch item {}, camera {} has no camera centre (its left 3 x 3 part "
          "has determinant {}); it must be that of a perspective camera, K [R|t]",
          op, i / cameras, i % cameras, determinant);
    }
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) ray[3 * r + c] = cofactor(c, r) / determinant;
      centre[r] = -(ray[3 * r] * p[3] + ray[3 * r + 1] * p[7] + ray[3 * r + 2] * p[11]);
    }
  }
  return out;
}

std::vector<shading::ViewGeometry> shading::view_geometry(const ViewTensors& views) {
  std::vector<ViewGeometry> out(views.centre.size(0) * views.centre.size(1));
  const double* ray = views.ray.data_ptr<double>();
  const double* centre = views.centre.data_ptr<double>();
  for (ViewGeometry& g : out) {
    for (float& x : g.ray) x = static_cast<float>(*ray++);
    for (float& x : g.centre) x = static_cast<float>(*centre++);
  }
  return out;
}

Tensor shading::at_least_two_texels(const Tensor& texture) {
  Tensor out = texture;
  for (const std::int64_t axis : {1, 2}) {
    if (out.size(axis) == 1) out = torch::cat({out, out}, axis);
  }
  return out;
}

namespace {

/// Checks the arguments of a drawing. @return the texture as the kernels need it
Tensor check_drawing(const Tensor& vertices, const Tensor& texture, const Tensor& lighting, const Tensor& projection,
                     const RenderMesh& mesh, std::int64_t height, std::int64_t width, const ShadingOptions& options) {
  check_mesh("shade", vertices, projection, mesh, options.z_near);
  render::check_image_size(height, width, "shade");
  if (texture.defined()) check_texture(texture, vertices, projection.size(1), mesh);
  if (options.lit) check_lighting(lighting, vertices, projection.size(1));
  return texture.defined() ? shading::at_least_two_texels(texture) : texture;
}

}  // namespace

ShadedImage shade(const Tensor& vertices, const Tensor& texture, const Tensor& lighting, const Tensor& projection,
                  const RenderMesh& mesh, std::int64_t height, std::int64_t width, const ShadingOptions& options) {
  const Tensor wide = check_drawing(vertices, texture, lighting, projection, mesh, height, width, options);
  return takes_kernel(vertices, options.use_reference)
             ? shading::fused(vertices, wide, lighting, projection, mesh, height, width, options)
             : shading::reference(vertices, wide, lighting, projection, mesh, height, width, options);
}

Tensor SupersampledImage::over(const Tensor& background) const { return image + (1 - alpha).unsqueeze(4) * background; }

SupersampledImage shade_supersampled(const Tensor& vertices, const Tensor& texture, const Tensor& lighting,
                                     const Tensor& projection, const RenderMesh& mesh, std::int64_t height,
                                     std::int64_t width, int factor, const ShadingOptions& options) {
  const torch::NoGradGuard no_gradient;
  const std::int64_t rows = height * factor, columns = width * factor;
  const Tensor wide = check_drawing(vertices, texture, lighting, projection, mesh, rows, columns, options);
  Tensor fine = projection.clone();
  fine.slice(2, 0, 2).mul_(factor);  // pixel edges scale, not pixel centres
  if (takes_kernel(vertices, options.use_reference))
    return shading::fused_supersampled(vertices, wide, lighting, fine, mesh, rows, columns, factor, options);
  const ShadedImage drawn = shading::reference(vertices, wide, lighting, fine, mesh, rows, columns, options);
  const auto average = [&](const Tensor& t) {
    return t.view({t.size(0), t.size(1), height, factor, width, factor, -1}).mean({3, 5});
  };
  return {average(drawn.colour), average(drawn.mask.to(drawn.colour.dtype())).squeeze(4)};
}

Tensor target_on_surface(const Tensor& vertices, const Tensor& projection, const RenderMesh& mesh, const Tensor& target,
                         const TargetOptions& options, const ShadedImage* drawn) {
  const char* const op = "target_on_surface";
  check_mesh(op, vertices, projection, mesh, options.z_near);
  check(op, "target", target, vertices, {vertices.size(0), projection.size(1), -1, -1, 3}, "[B,C,H,W,3]");
  const std::int64_t height = target.size(2), width = target.size(3);
  render::check_image_size(height, width, op);
  if (options.radius < 1 || options.radius > 16) {
    fail<UsageError>("{}: radius is {}; it must be 1 to 16 pixels", op, options.radius);
  }
  if (drawn != nullptr && drawn->mask.sizes() != target.sizes().slice(0, 4)) {
    fail<UsageError>("{}: `drawn` is {}, the target {}; they must show the same views at the same size", op,
                     describe(drawn->mask), describe(target));
  }
  if (!takes_kernel(vertices, options.use_reference)) {
    return shading::target_reference(vertices, projection, mesh, target, options);
  }
  return shading::target_fused(vertices, projection, mesh, target, options, drawn ? drawn->fragments : Fragments{});
}

Tensor target_on_surface(const Tensor& vertices, const Tensor& projection, const RenderMesh& mesh, const Tensor& target,
                         int radius) {
  TargetOptions options;
  options.radius = radius;
  return target_on_surface(vertices, projection, mesh, target, options, nullptr);
}

}  // namespace doppel
