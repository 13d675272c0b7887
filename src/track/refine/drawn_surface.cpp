#include "doppel/track/refine/drawn_surface.h"

#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/geometry/image_box.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/projection.h"

namespace doppel {
namespace {

constexpr int kBoxMargin = 24;  // pixels around the surface: as far as the film may show it

}  // namespace

SurfaceDrawer::SurfaceDrawer(const TriangleMesh& mesh) : texture_(mesh.texture), rasterizer_(RenderMesh(mesh).faces) {
  if (mesh.uvs.empty() || texture_.empty()) fail("the character has no texture, so its surface cannot be drawn");
  for (const Triangle& corners : mesh.face_uvs) {
    std::array<Eigen::Vector2f, 3>& texels = corner_texels_.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector2d uv = mesh.uvs[corners[k]];
      texels[k] = {static_cast<float>(uv.x() * texture_.cols - 0.5),
                   static_cast<float>((1 - uv.y()) * texture_.rows - 0.5)};
    }
  }
}

DrawnSurface SurfaceDrawer::draw(const std::vector<Eigen::Vector3d>& vertices, const PinholeCamera& camera) {
  const torch::NoGradGuard no_grad;
  DrawnSurface drawn;
  drawn.box = image_box(vertices, camera, kBoxMargin);
  if (drawn.empty()) return drawn;
  const PinholeCamera part = camera.cropped(drawn.box.x, drawn.box.y, 1.0, drawn.box.width, drawn.box.height);
  const RasterImage& raster = rasterizer_.rasterize_projected(
      vertex_tensor(vertices), projection_tensor({part}).unsqueeze(0), part.height, part.width);
  const cv::Size size = drawn.box.size();
  drawn.depth = cv::Mat(size, CV_32F, raster.depth.data_ptr<float>()).clone();
  cv::Mat x(size, CV_32F, cv::Scalar(-1)), y(size, CV_32F, cv::Scalar(-1));
  const int* face = raster.face_id.data_ptr<int>();
  const float* share = raster.barycentrics.data_ptr<float>();
  for (int i = 0; i < size.area(); ++i, share += 3) {
    if (face[i] < 0) continue;
    const std::array<Eigen::Vector2f, 3>& corners = corner_texels_[face[i]];
    const Eigen::Vector2f texel = share[0] * corners[0] + share[1] * corners[1] + share[2] * corners[2];
    x.ptr<float>()[i] = texel.x();
    y.ptr<float>()[i] = texel.y();
  }
  drawn.covered = cv::Mat(size, CV_32S, raster.face_id.data_ptr<int>()) >= 0;
  cv::remap(texture_, drawn.colour, x, y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  drawn.colour.setTo(cv::Scalar::all(0), drawn.covered == 0);
  return drawn;
}

}  // namespace doppel
