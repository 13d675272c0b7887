#pragma once

/// Where along a ray a radiance field around a mesh is sampled (6.24): from t_mi before the nearest to t_ma behind the
/// farthest surface seen around the ray's pixel.
///
///   near = er(depth) - t_mi,   far = di(depth) + t_ma
///
/// er and di are the least and the largest depth of the stencil's pixels that show the mesh; pixels that do not are
/// left out of both (as if the background were at infinity for er and at 0 for di).
/// Letters: B batch, C cameras, V = B*C views, N vertices, F faces, R rays. Metres along unit rays from the camera.

#include <torch/torch.h>

#include "doppel/render/rasterizer.h"

namespace doppel {

struct GuideOptions {
  double t_mi = 0.04;  ///< metres before the surface
  double t_ma = 0.04;  ///< metres behind it
  int stencil = 9;     ///< pixels along a side, odd
};

/// Rays through the centres of pixels.
struct PixelRays {
  torch::Tensor origin;     ///< [3] camera centre, world
  torch::Tensor direction;  ///< [R,3] unit, world
};
/// @param projection [3,4] pixels from world metres @param pixels int64 [R,2]: column, row
/// @return in the type of `projection`
PixelRays pixel_rays(const torch::Tensor& projection, const torch::Tensor& pixels);

/// Views of the mesh that say where its surface is.
struct GuideImages {
  torch::Tensor face_id;   ///< int32 [V,H,W] nearest face, -1 background
  torch::Tensor distance;  ///< float32 [V,H,W] of the surface along the pixel's ray, infinity background
  torch::Tensor reached;   ///< bool [V,H,W]: the mesh is seen within the stencil, so the pixel's ray is sampled

  /// Pixels (column, row) of a view that are sampled: int64 [R,2], none where the mesh is out of view.
  torch::Tensor pixels(int64_t view) const;
};
/// @param rasterizer of the faces below @param faces int64 [F,3] @param vertices float32 [B,N,3] of a closed mesh,
/// world
/// @param projection float32 [B,C,3,4] pixels from world metres
/// @throws Error when a camera stands inside the mesh: most of what it sees is the inside of faces
/// @throws UsageError for an even stencil, or lengths that are not greater than 0
GuideImages guide_images(Rasterizer& rasterizer, const torch::Tensor& faces, const torch::Tensor& vertices,
                         const torch::Tensor& projection, int64_t height, int64_t width,
                         const GuideOptions& options = {});

struct RayInterval {
  torch::Tensor near, far;  ///< [R], 0 <= near <= far; both 0 for pixels that are not reached: empty rays
};
/// The intervals of pixels of one view.
/// @param pixels int64 [R,2] column, row, within the image
/// @param faces int64 [F,3] @param vertices [N,3] that were drawn, any float type @param projection [3,4] of the view
/// Gradient: to the vertices, exact but for what is visible: the face seen at the nearest and farthest pixel stays, the
/// place where that pixel's ray meets its plane moves. Faces seen almost edge-on (below 0.6 degrees) pass none.
RayInterval guided_interval(const GuideImages& guide, int64_t view, const torch::Tensor& pixels,
                            const torch::Tensor& faces, const torch::Tensor& vertices, const torch::Tensor& projection,
                            const GuideOptions& options = {});

/// Random pixels of a view for training: half of those that are reached, half of those also in the mask (all of the
/// former where the mask holds none), with repetition.
/// @param mask [H,W], foreground above 0.5 @return int64 [count,2] column, row
/// @throws Error when the mesh is out of view
torch::Tensor draw_pixels(const GuideImages& guide, int64_t view, const torch::Tensor& mask, int64_t count,
                          at::Generator generator);

}  // namespace doppel
