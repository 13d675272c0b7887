#pragma once

/// The interval of a ray in which a radiance field around a mesh is sampled (6.24): from t_mi before the nearest to
/// t_ma behind the farthest surface around the ray's pixel.
///
///   near = er(depth) - t_mi,   far = di(depth) + t_ma
///
/// er and di are the smallest and the largest depth among the pixels of the stencil that show the mesh. Background
/// pixels are left out of both, as if they had depth infinity in er and 0 in di.
/// Letters: B batch, C cameras, V = B*C views, N vertices, F faces, R rays. Metres along unit rays from the camera.

#include <torch/types.h>

#include "doppel/render/raster/rasterizer.h"

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

/// Drawn views of the mesh: the face and the distance of the surface in each pixel.
struct GuideImages {
  torch::Tensor face_id;   ///< int32 [V,H,W] nearest face, -1 background
  torch::Tensor distance;  ///< float32 [V,H,W] of the surface along the pixel's ray, infinity background
  torch::Tensor reached;   ///< bool [V,H,W]: the stencil contains the mesh, so the pixel's ray is sampled

  /// Pixels (column, row) of a view that are sampled: int64 [R,2], none where the mesh is out of view.
  torch::Tensor pixels(int64_t view) const;
};
/// @param rasterizer built from `faces` @param faces int64 [F,3]
/// @param vertices float32 [B,N,3] of a closed mesh, world
/// @param projection float32 [B,C,3,4] pixels from world metres
/// @throws Error when a camera is inside the mesh: most pixels then show the inside of faces
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
/// Gradient: to the vertices, exact at fixed visibility: the nearest and farthest pixels keep their faces, and the
/// intersections of their rays with the planes of the faces move. Faces at less than 0.6 degrees to the ray pass none.
RayInterval guided_interval(const GuideImages& guide, int64_t view, const torch::Tensor& pixels,
                            const torch::Tensor& faces, const torch::Tensor& vertices, const torch::Tensor& projection,
                            const GuideOptions& options = {});

/// Random pixels of a view for training, with repetition. A share is drawn from the reached pixels inside the mask (or
/// from all reached pixels if the mask contains none), the others from all reached pixels. A share of 0 is the sampling
/// of the thesis (A.3), which draws from the whole view and discards pixels that are not reached.
/// @param mask [H,W], foreground above 0.5 @param in_mask the share, 0..1, rounded down to a number of pixels
/// @return int64 [count,2] column, row
/// @throws Error when the mesh is out of view
torch::Tensor draw_pixels(const GuideImages& guide, int64_t view, const torch::Tensor& mask, int64_t count,
                          double in_mask, at::Generator generator);

}  // namespace doppel
