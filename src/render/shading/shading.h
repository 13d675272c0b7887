#pragma once

#include <torch/types.h>

#include "doppel/render/render_mesh.h"
#include "doppel/render/shading/shading_types.h"

namespace doppel {

/// Draws a textured mesh under spherical-harmonics lighting: colour = texture(uv) * sum_j l_j SH_j(normal), the normal
/// interpolated from the area-weighted vertex normals, barycentrics perspective-correct, texture bilinear and clamped
/// at its border.
///
/// Gradients to vertices, texture and lighting at fixed visibility: a pixel keeps its face. The gradient to the
/// vertices passes through barycentrics and UVs, and through barycentrics and vertex normals with their whole one-ring.
/// No gradient passes through the outline, occlusion, or the flip of a normal. None passes through the barycentrics of
/// a pixel that lies on an edge or (by rounding) outside its face, or that sees its face at |cos| < 0.001.
///
/// @param vertices float32 or float64 [B,N,3], world, metres
/// @param texture [Bt,Th,Tw,3], Bt = 1, B or B*C (one per view); undefined: white
/// @param lighting [B,C,3,9] or [1,C,3,9], coefficients per channel (sh_lighting.h); needed if options.lit
/// @param projection [B,C,3,4], pixels from world metres; skew and any principal point allowed. No gradient.
/// float32 on the CPU runs the kernel; everything else, tracing and options.use_reference run the reference. The result
/// has the same bits for any number of threads.
/// @throws Error for wrong shapes or types, a texture without UVs, a projection without a centre
/// Equations: 6.10, 6.11, 6.12
ShadedImage shade(const torch::Tensor& vertices, const torch::Tensor& texture, const torch::Tensor& lighting,
                  const torch::Tensor& projection, const RenderMesh& mesh, std::int64_t height, std::int64_t width,
                  const ShadingOptions& options = {});

/// The target image as a function of the surface points. The value is `target`. The gradient to the vertices is that of
/// the image value at a surface point that moves with the vertices (barycentrics fixed). A loss that compares
/// `shade(...)` with this result instead of `target` also uses the image gradient of the target, which enlarges the
/// basin of convergence. The gradient is a surrogate, not the derivative of the value, which does not depend on the
/// vertices.
///
/// The image gradient is a sum with taps x / (x^2 + y^2) over (2 radius + 1)^2 pixels, scaled to be exact for a linear
/// image; it is 0 within `radius` of the border and where nothing is drawn.
/// @param target [B,C,H,W,3]; receives the gradient of the result unchanged
/// @param drawn the result of `shade` for the same vertices and cameras, which saves a second drawing; or nothing
/// @return [B,C,H,W,3], equal to target
/// @throws Error for wrong shapes or types
torch::Tensor target_on_surface(const torch::Tensor& vertices, const torch::Tensor& projection, const RenderMesh& mesh,
                                const torch::Tensor& target, const TargetOptions& options,
                                const ShadedImage* drawn = nullptr);
torch::Tensor target_on_surface(const torch::Tensor& vertices, const torch::Tensor& projection, const RenderMesh& mesh,
                                const torch::Tensor& target, int radius = 1);

}  // namespace doppel
