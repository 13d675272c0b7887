#include "doppel/data/capture/template_check.h"

#include <fmt/format.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "doppel/layers/surface.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/raster/rasterizer.h"

namespace doppel {

namespace {

constexpr int kCheckWidth = 640;      // enough to detect a wrong camera, and fast for images of any size
constexpr double kClearlyFits = 0.6;  // a correction that reaches this IoU is reported

double mask_iou(const cv::Mat& a, const cv::Mat& b) {
  const int both = cv::countNonZero(a & b), either = cv::countNonZero(a | b);
  return either == 0 ? 0.0 : static_cast<double>(both) / either;
}

/// The camera that results when camera-to-world extrinsics are read as world-to-camera.
Camera inverted(const Camera& camera) {
  Camera result = camera;
  result.R = camera.R.transpose();
  result.t = -camera.R.transpose() * camera.t;
  return result;
}

Camera with_translation_scaled(const Camera& camera, double scale) {
  Camera result = camera;
  result.t *= scale;
  return result;
}

/// Axes of OpenGL (y up, z backward) read as OpenCV's.
Camera with_flipped_axes(const Camera& camera) {
  Camera result = camera;
  const Eigen::Matrix3d flip = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  result.R = flip * camera.R;
  result.t = flip * camera.t;
  return result;
}

cv::Mat flipped(const cv::Mat& mask, int code) {
  cv::Mat result;
  cv::flip(mask, result, code);
  return result;
}

}  // namespace

struct TemplateChecker::State {
  CharacterSurface surface;
  Rasterizer rasterizer;
};

TemplateChecker::TemplateChecker(const Character& character)
    : state_(new State{CharacterSurface(character), Rasterizer(face_tensor(character.mesh))}) {}
TemplateChecker::~TemplateChecker() = default;

Eigen::Matrix3Xf TemplateChecker::skin(const std::vector<double>& dofs) {
  const torch::NoGradGuard no_grad;
  const torch::Tensor row = torch::tensor(dofs, torch::kFloat64).to(torch::kFloat32).unsqueeze(0);
  const torch::Tensor vertices = state_->surface->skinned(row).squeeze(0).contiguous();
  return Eigen::Map<const Eigen::Matrix3Xf>(vertices.data_ptr<float>(), 3, vertices.size(0));
}

cv::Mat TemplateChecker::silhouette(const Eigen::Matrix3Xf& vertices, const Camera& camera) {
  torch::Tensor projection = torch::empty({1, 1, 3, 4}, torch::kFloat32);
  const Eigen::Matrix<double, 3, 4> p = camera.projection();
  for (int i = 0; i < 12; ++i) projection.data_ptr<float>()[i] = static_cast<float>(p(i / 4, i % 4));
  // Read only: from_blob has no const variant.
  const torch::Tensor posed = torch::from_blob(const_cast<float*>(vertices.data()), {1, vertices.cols(), 3});
  const torch::Tensor covered =
      state_->rasterizer.coverage_projected(posed, projection, camera.height, camera.width).contiguous();
  const cv::Mat view(camera.height, camera.width, CV_8U, covered.data_ptr<std::uint8_t>());
  return view * 255;
}

std::optional<double> TemplateChecker::iou(const Eigen::Matrix3Xf& vertices, const Camera& camera,
                                           const cv::Mat& mask) {
  if (cv::countNonZero(mask) == 0) return std::nullopt;
  if (camera.width <= kCheckWidth) return mask_iou(silhouette(vertices, camera), mask);
  const double scale = static_cast<double>(kCheckWidth) / camera.width;
  const int height = std::max(1, static_cast<int>(std::lround(camera.height * scale)));
  cv::Mat small;
  cv::resize(mask, small, {kCheckWidth, height}, 0.0, 0.0, cv::INTER_AREA);
  return mask_iou(silhouette(vertices, camera.cropped(0.0, 0.0, scale, kCheckWidth, height)), small > 127);
}

CameraView look_at(const Eigen::Matrix3Xf& vertices, const Camera& camera) {
  CameraView view;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  long front = 0, inside = 0;
  for (Eigen::Index i = 0; i < vertices.cols(); ++i) {
    const Eigen::Vector3d point = vertices.col(i).cast<double>();
    sum += point;
    if (camera.camera_from_world(point).z() <= 0.0) continue;
    ++front;
    const Eigen::Vector3d pixel = camera.K * camera.camera_from_world(point);
    const double u = pixel.x() / pixel.z(), v = pixel.y() / pixel.z();
    if (u >= 0.0 && v >= 0.0 && u <= camera.width && v <= camera.height) ++inside;
  }
  const auto count = static_cast<double>(std::max<Eigen::Index>(vertices.cols(), 1));
  view.distance = (sum / count - camera.centre()).norm();
  view.share_in_front = front / count;
  view.share_in_image = inside / count;
  return view;
}

std::string explain_misfit(TemplateChecker& checker, const Eigen::Matrix3Xf& vertices, const Camera& camera,
                           const cv::Mat& mask) {
  struct Guess {
    std::string sentence;
    Camera camera;
    cv::Mat mask;
  };
  const std::vector<Guess> guesses{
      {"the images look mirrored left to right", camera, flipped(mask, 1)},
      {"the images look upside down", camera, flipped(mask, 0)},
      {"the images look turned by half a turn", camera, flipped(mask, -1)},
      {"the extrinsics look like camera-to-world where world-to-camera is expected", inverted(camera), mask},
      {"the camera's axes look like OpenGL's (y up, z backward) where OpenCV's are expected", with_flipped_axes(camera),
       mask},
      {"the translation looks like metres in a file that counts in millimetres",
       with_translation_scaled(camera, 1000.0), mask},
      {"the translation looks like millimetres in a file that counts in metres", with_translation_scaled(camera, 0.001),
       mask},
  };
  std::string best;
  double best_iou = kClearlyFits;
  for (const Guess& guess : guesses) {
    const double iou = checker.iou(vertices, guess.camera, guess.mask).value_or(0.0);
    if (iou <= best_iou) continue;
    best_iou = iou;
    best = fmt::format("{} (with this correction the IoU would be {:.2f})", guess.sentence, iou);
  }
  return best;
}

}  // namespace doppel
