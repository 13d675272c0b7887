#include "doppel/track/track_view.h"

#include <torch/utils.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/core/tensor/image_tensor.h"
#include "doppel/render/lighting/soft_light.h"
#include "doppel/render/projection.h"
#include "doppel/render/shading/buffers.h"

namespace doppel {

namespace {

constexpr double kAlbedo = 0.75;
constexpr double kSurfaceShare = 0.8;  // opacity of the surface over the image; a try-on texture is opaque
const cv::Scalar kGrey(60, 54, 52);

int even(double length) { return 2 * static_cast<int>(length / 2.0); }

Camera smaller_camera(const PinholeCamera& camera, int highest) {
  const double scale = std::min(1.0, static_cast<double>(highest) / camera.height);
  return camera.cropped(0.0, 0.0, scale, even(camera.width * scale), even(camera.height * scale));
}

torch::Tensor texture_for(const TriangleMesh& mesh, const RenderMesh& drawn, const cv::Mat& texture) {
  if (texture.empty()) return {};
  if (!drawn.has_uvs()) fail<UsageError>("the template has no texture coordinates, so no texture can be drawn on it");
  TriangleMesh dressed = mesh;
  dressed.texture = composite(texture, mesh.texture);
  return texture_tensor(dressed);
}

Eigen::Vector3d middle_of(const torch::Tensor& vertices) {
  const torch::Tensor middle = (vertices.amax(0) + vertices.amin(0)).mul(0.5).to(torch::kFloat64).contiguous();
  return Eigen::Map<const Eigen::Vector3d>(middle.data_ptr<double>());
}

}  // namespace

cv::Mat composite(const cv::Mat& over, const cv::Mat& under) {
  if (over.channels() != 4) return over;
  cv::Mat base(over.size(), CV_8UC3, kGrey);
  if (!under.empty()) cv::resize(under, base, over.size(), 0.0, 0.0, cv::INTER_AREA);
  cv::Mat opaque, alpha, result;
  cv::cvtColor(over, opaque, cv::COLOR_BGRA2BGR);
  cv::extractChannel(over, alpha, 3);
  alpha.convertTo(alpha, CV_32F, 1.0 / 255.0);
  cv::blendLinear(opaque, base, alpha, 1.0 - alpha, result);
  return result;
}

torch::Tensor tensor_of_vertices(const Eigen::Matrix3Xd& vertices) {
  torch::Tensor tensor = torch::empty({vertices.cols(), 3});
  Eigen::Map<Eigen::Matrix3Xf>(tensor.data_ptr<float>(), 3, vertices.cols()) = vertices.cast<float>();
  return tensor;
}

PinholeCamera turned_about(const PinholeCamera& camera, const Eigen::Vector3d& centre, double angle) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
  PinholeCamera turned = camera;
  turned.R = camera.R * turn.transpose();
  turned.t = -turned.R * (centre + turn * (camera.centre() - centre));
  return turned;
}

TrackView::TrackView(const PinholeCamera& camera, const TriangleMesh& mesh, const TrackViewOptions& options)
    : camera_(smaller_camera(camera, options.highest)),
      mesh_(mesh),
      options_(options),
      texture_(texture_for(mesh, mesh_, options.texture)) {}

cv::Mat TrackView::draw(const cv::Mat& image, const torch::Tensor& vertices) const {
  const cv::Size panel(camera_.width, camera_.height);
  const cv::Mat plain(panel, CV_8UC3, kGrey);
  cv::Mat behind;
  if (image.empty())
    behind = plain;
  else
    cv::resize(image, behind, panel, 0.0, 0.0, cv::INTER_AREA);
  cv::Mat front = behind, side = plain;
  if (vertices.defined()) {
    front = draw_surface(vertices, camera_, behind);
    if (!texture_.defined()) cv::addWeighted(front, kSurfaceShare, behind, 1.0 - kSurfaceShare, 0.0, front);
    const double angle = options_.angle * M_PI / 180.0;
    side = draw_surface(vertices, turned_about(camera_, middle_of(vertices), angle), plain);
  }
  cv::Mat both;
  cv::hconcat(front, side, both);
  return both;
}

cv::Mat TrackView::draw_surface(const torch::Tensor& vertices, const PinholeCamera& camera,
                                const cv::Mat& behind) const {
  const torch::NoGradGuard no_grad;
  RenderScene scene;
  scene.vertices = vertices.unsqueeze(0);
  scene.projection = projection_tensor({camera}).unsqueeze(0);
  scene.texture = texture_;
  scene.lighting = soft_light(camera, texture_.defined() ? 1.0 : kAlbedo);
  const SupersampledImage drawn =
      render_supersampled(scene, mesh_, camera.height, camera.width, RenderMode::colour, options_.supersampling);
  return image_of(drawn.over(tensor_of(behind))[0][0]);
}

}  // namespace doppel
