#pragma once

#include <torch/types.h>

#include <cstdint>
#include <memory>

namespace doppel {

struct RasterizerOptions {
  float z_near = 0.01f;  ///< metres; parts nearer to the camera plane are cut away
  bool cull = false;     ///< drop faces seen from their inside (clockwise in the image)
};

/// The nearest face in each pixel of V views.
struct RasterImage {
  torch::Tensor face_id;       ///< int32 [V,H,W], nearest face, -1 background; equal depth: the lower index
  torch::Tensor depth;         ///< float32 [V,H,W], metres along the camera's z axis, infinity background
  torch::Tensor barycentrics;  ///< float32 [V,H,W,3], perspective-correct, of the corners of `face_id`; 0 background
};

/// Draws triangle meshes on the CPU: tiled, vectorised, parallel over views and tiles.
///
/// A pixel is covered when its centre (integer + 0.5) lies in the triangle whose corners are rounded to 1/256 pixel. On
/// an edge the top-left rule decides, so neighbouring faces leave no gap and never draw a pixel twice. Faces that
/// cross the near plane are cut there; depth and barycentrics are those of the whole face. The result is the same
/// bit for bit with any number of threads and on any instruction set.
class Rasterizer {
 public:
  /// @param faces int32 or int64 [F,3] vertex indices, counter-clockwise from outside
  /// @throws Error for another shape or type, or a negative index
  explicit Rasterizer(const torch::Tensor& faces, const RasterizerOptions& options = {});
  ~Rasterizer();
  Rasterizer(const Rasterizer&) = delete;
  Rasterizer& operator=(const Rasterizer&) = delete;
  Rasterizer(Rasterizer&&) noexcept;
  Rasterizer& operator=(Rasterizer&&) noexcept;

  /// @param vertices_in_camera float32 [V,N,3], metres, OpenCV axes
  /// @param intrinsics float32 [V,4] or [1,4]: fx fy cx cy, pixels
  /// @param height,width of the images, 1 to 16384
  /// @return images that this object owns and overwrites at the next call. Copy what must outlive that call, and do not
  ///   write into the images, because the next call clears only the parts that were drawn.
  /// @throws Error for wrong shapes, types or sizes, or a face index beyond N
  const RasterImage& rasterize(const torch::Tensor& vertices_in_camera, const torch::Tensor& intrinsics,
                               std::int64_t height, std::int64_t width);

  /// As above, for world vertices and projection matrices. Each batch item has its own cameras.
  /// @param vertices float32 [B,N,3], metres; @param projection float32 [B,C,3,4] pixels from world metres
  /// @return as `rasterize`, of V = B*C views
  const RasterImage& rasterize_projected(const torch::Tensor& vertices, const torch::Tensor& projection,
                                         std::int64_t height, std::int64_t width);

  /// Whether any face covers the pixel. @return uint8 [V,H,W], 1 covered, 0 not; fresh at each call.
  torch::Tensor coverage(const torch::Tensor& vertices_in_camera, const torch::Tensor& intrinsics, std::int64_t height,
                         std::int64_t width);

  /// As above, for world vertices and projection matrices. Each batch item has its own cameras.
  /// @param vertices float32 [B,N,3], metres; @param projection float32 [B,C,3,4] pixels from world metres
  /// @return uint8 [B,C,H,W]
  torch::Tensor coverage_projected(const torch::Tensor& vertices, const torch::Tensor& projection, std::int64_t height,
                                   std::int64_t width);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// One call of Rasterizer::rasterize with newly allocated outputs; also the dispatcher op `doppel::rasterize`. Keep a
/// Rasterizer for repeated calls: the page faults of new images cost more than the drawing.
RasterImage rasterize(const torch::Tensor& vertices_in_camera, const torch::Tensor& intrinsics,
                      const torch::Tensor& faces, std::int64_t height, std::int64_t width,
                      const RasterizerOptions& options = {});

}  // namespace doppel
