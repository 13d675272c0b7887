#pragma once

#include <torch/types.h>

#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/shading/shading_types.h"

namespace doppel {

/// Draws a textured mesh under spherical-harmonics lighting. The colour of a pixel that shows the mesh is
///
///   texture(uv) * sum_j l_j SH_j(normal)          Equations: 6.10, 6.11, 6.12
///
/// The normal is interpolated from the area-weighted vertex normals. Barycentrics are perspective-correct. The texture
/// is sampled bilinearly and clamped at its border.
///
/// Gradients go to vertices, texture and lighting. Visibility is fixed: a pixel keeps its face. The gradient to the
/// vertices has two parts: one through the UVs of the pixel, and one through its normal. Both pass through the
/// barycentrics. The second also passes through the vertex normals, and so reaches all neighbours of a face's corners.
/// No gradient passes through the outline, through occlusion, or through the flip of a normal. No gradient passes
/// through the barycentrics of a pixel that lies on an edge of its face, or by rounding outside it. The same holds
/// where the face is seen edge-on: |cos| < 0.001 of the angle between the ray and the face's normal.
///
/// float32 runs the kernel, which has no second derivative. float64, a torch::jit trace and options.use_reference run
/// the reference. The result has the same bits for any number of threads.
///
/// All tensors are on the CPU and have the type of `vertices`.
/// @param vertices [B,N,3] float32 or float64, world metres
/// @param texture [Bt,Th,Tw,3] with row 0 at v = 1; Bt is 1 (for all views), B (one per item) or B*C (one per view);
/// undefined: white
/// @param lighting [B,C,3,9] or [1,C,3,9], coefficients per colour channel (sh_lighting.h); ignored, and may be
/// undefined, when options.lit is false
/// @param projection [B,C,3,4] pixels from world metres, pixel centres at +0.5. Skew and any principal point are
/// allowed. A matrix of zeros gives an empty image. It receives no gradient.
/// @param height, width of the images, 1 to 16384 pixels
/// @return images [B,C,height,width,3] and masks (shading_types.h)
/// @throws UsageError for wrong shapes or types, for a texture on a mesh without UVs, for lighting that is missing, and
/// for a projection without a camera centre
ShadedImage shade(const torch::Tensor& vertices, const torch::Tensor& texture, const torch::Tensor& lighting,
                  const torch::Tensor& projection, const RenderMesh& mesh, std::int64_t height, std::int64_t width,
                  const ShadingOptions& options = {});

/// `shade` with factor x factor samples for each pixel, averaged. The large image is never held in memory. Without
/// gradients.
SupersampledImage shade_supersampled(const torch::Tensor& vertices, const torch::Tensor& texture,
                                     const torch::Tensor& lighting, const torch::Tensor& projection,
                                     const RenderMesh& mesh, std::int64_t height, std::int64_t width, int factor,
                                     const ShadingOptions& options = {});

/// The target image with a gradient to the vertices. The value of the result is `target`. For the gradient, every pixel
/// is tied to the surface point that it shows, with fixed barycentrics. When the vertices move, the projection of this
/// point moves, and the colour changes by the image gradient of the target. A loss that compares `shade(...)` with this
/// result instead of `target` also uses the image gradient of the target. This enlarges the basin of convergence. The
/// gradient is a surrogate: it is not the derivative of the value, because the value does not depend on the vertices.
///
/// The image gradient at a pixel is a weighted sum over the (2 radius + 1)^2 pixels around it. The pixel at the offset
/// (x, y) has the weight x / (x^2 + y^2) in the derivative along x, and y / (x^2 + y^2) in that along y. The sum is
/// scaled so that it is exact for a linear image. It is 0 within `radius` of the border and where nothing is drawn.
///
/// All tensors are on the CPU and have the type of `vertices`. Kernel and reference as in `shade`.
/// @param vertices [B,N,3] world metres @param projection [B,C,3,4] as for `shade`
/// @param target [B,C,H,W,3]; receives the gradient of the result unchanged
/// @param options radius from 1 to 16 pixels, z_near in metres
/// @param drawn the result of `shade` for the same vertices, cameras and z_near. Its visible faces are then not
/// computed again. Null, or a result without fragments: they are computed.
/// @return [B,C,H,W,3], equal to target
/// @throws UsageError for wrong shapes, types or options
torch::Tensor target_on_surface(const torch::Tensor& vertices, const torch::Tensor& projection, const RenderMesh& mesh,
                                const torch::Tensor& target, const TargetOptions& options,
                                const ShadedImage* drawn = nullptr);
/// The same with this radius, all other options at their defaults, and without `drawn`.
torch::Tensor target_on_surface(const torch::Tensor& vertices, const torch::Tensor& projection, const RenderMesh& mesh,
                                const torch::Tensor& target, int radius = 1);

}  // namespace doppel
