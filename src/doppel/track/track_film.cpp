#include "doppel/track/track_film.h"

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "doppel/data/picture_tensor.h"
#include "doppel/render/buffers.h"
#include "doppel/render/projection.h"
#include "doppel/render/soft_light.h"

namespace doppel {

namespace {

constexpr int kHighest = 720;
constexpr double kAlbedo = 0.75;
constexpr double kSurfaceShare = 0.8;  // of the overlay: the picture shines through
const cv::Scalar kGrey(60, 54, 52);

int even(double length) { return 2 * static_cast<int>(length / 2.0); }

Camera film_camera(const Camera& camera) {
  const double scale = std::min(1.0, static_cast<double>(kHighest) / camera.height);
  return camera.cropped(0.0, 0.0, scale, even(camera.width * scale), even(camera.height * scale));
}

Eigen::Vector3d middle_of(const torch::Tensor& vertices) {
  const torch::Tensor middle = (vertices.amax(0) + vertices.amin(0)).mul(0.5).to(torch::kFloat64).contiguous();
  return Eigen::Map<const Eigen::Vector3d>(middle.data_ptr<double>());
}

}  // namespace

Camera seen_from_the_side(const Camera& camera, const Eigen::Vector3d& centre) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitY()).toRotationMatrix();
  Camera side = camera;
  side.R = camera.R * turn.transpose();
  side.t = -side.R * (centre + turn * (camera.centre() - centre));
  return side;
}

TrackFilm::TrackFilm(const std::filesystem::path& path, const Camera& camera, const TriangleMesh& mesh,
                     double frames_per_second)
    : camera_(film_camera(camera)),
      mesh_(mesh),
      video_(std::make_unique<VideoFile>(path, cv::Size(2 * camera_.width, camera_.height), frames_per_second)) {}

void TrackFilm::add(const cv::Mat& picture, const torch::Tensor& vertices) {
  const cv::Size panel(camera_.width, camera_.height);
  const cv::Mat plain(panel, CV_8UC3, kGrey);
  cv::Mat behind;
  if (picture.empty())
    behind = plain;
  else
    cv::resize(picture, behind, panel, 0.0, 0.0, cv::INTER_AREA);
  cv::Mat front = behind, side = plain;
  if (vertices.defined()) {
    cv::addWeighted(draw(vertices, camera_, behind), kSurfaceShare, behind, 1.0 - kSurfaceShare, 0.0, front);
    side = draw(vertices, seen_from_the_side(camera_, middle_of(vertices)), plain);
  }
  cv::Mat both;
  cv::hconcat(front, side, both);
  video_->write(both);
}

cv::Mat TrackFilm::draw(const torch::Tensor& vertices, const Camera& camera, const cv::Mat& behind) const {
  RenderScene scene;
  scene.vertices = vertices.unsqueeze(0);
  scene.projection = projection_tensor({camera}).unsqueeze(0);
  scene.lighting = soft_light(camera, kAlbedo);
  const SupersampledImage drawn = render_supersampled(scene, mesh_, camera.height, camera.width, RenderMode::colour, 2);
  return picture_of(drawn.over(tensor_of(behind))[0][0]);
}

}  // namespace doppel
