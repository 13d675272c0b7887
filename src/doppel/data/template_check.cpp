#include "doppel/data/template_check.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "doppel/data/mask.h"
#include "doppel/render/face_tensor.h"

namespace doppel {

namespace {

constexpr int kCheckWidth = 640;      // enough to see a wrong camera, and quick on pictures of any size
constexpr double kClearlyFits = 0.6;  // a repair that reaches this IoU is worth naming

double mask_iou(const cv::Mat& a, const cv::Mat& b) {
  const int both = cv::countNonZero(a & b), either = cv::countNonZero(a | b);
  return either == 0 ? 0.0 : static_cast<double>(both) / either;
}

/// The camera a reader would get from extrinsics that were written camera-to-world.
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

TemplateChecker::TemplateChecker(const Character& character)
    : surface_(character), rasterizer_(face_tensor(character.mesh)) {}

torch::Tensor TemplateChecker::skin(const std::vector<double>& dofs) {
  torch::NoGradGuard no_grad;
  const torch::Tensor row = torch::tensor(dofs, torch::kFloat64).to(torch::kFloat32).unsqueeze(0);
  return surface_->skinned(row).squeeze(0).contiguous();
}

cv::Mat TemplateChecker::silhouette(const torch::Tensor& vertices, const Camera& camera) {
  torch::Tensor projection = torch::empty({1, 1, 3, 4}, torch::kFloat32);
  const Eigen::Matrix<double, 3, 4> p = camera.projection();
  for (int i = 0; i < 12; ++i) projection.data_ptr<float>()[i] = static_cast<float>(p(i / 4, i % 4));
  const torch::Tensor covered =
      rasterizer_.coverage_projected(vertices.unsqueeze(0), projection, camera.height, camera.width).contiguous();
  const cv::Mat view(camera.height, camera.width, CV_8U, covered.data_ptr<std::uint8_t>());
  return view * 255;
}

std::optional<double> TemplateChecker::iou(const torch::Tensor& vertices, const Camera& camera, const cv::Mat& mask) {
  if (cv::countNonZero(mask) == 0) return std::nullopt;
  if (camera.width <= kCheckWidth) return mask_iou(silhouette(vertices, camera), mask);
  const double scale = static_cast<double>(kCheckWidth) / camera.width;
  const int height = std::max(1, static_cast<int>(std::lround(camera.height * scale)));
  cv::Mat small;
  cv::resize(mask, small, {kCheckWidth, height}, 0.0, 0.0, cv::INTER_AREA);
  return mask_iou(silhouette(vertices, camera.cropped(0.0, 0.0, scale, kCheckWidth, height)), small > 127);
}

CameraView look_at(const torch::Tensor& vertices, const Camera& camera) {
  const auto points = vertices.accessor<float, 2>();
  CameraView view;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  long front = 0, inside = 0;
  for (std::int64_t i = 0; i < points.size(0); ++i) {
    const Eigen::Vector3d point(points[i][0], points[i][1], points[i][2]);
    sum += point;
    if (camera.camera_from_world(point).z() <= 0.0) continue;
    ++front;
    const Eigen::Vector3d pixel = camera.K * camera.camera_from_world(point);
    const double u = pixel.x() / pixel.z(), v = pixel.y() / pixel.z();
    if (u >= 0.0 && v >= 0.0 && u <= camera.width && v <= camera.height) ++inside;
  }
  const auto count = static_cast<double>(std::max<std::int64_t>(points.size(0), 1));
  view.distance = (sum / count - camera.centre()).norm();
  view.share_in_front = front / count;
  view.share_in_image = inside / count;
  return view;
}

std::string explain_misfit(TemplateChecker& checker, const torch::Tensor& vertices, const Camera& camera,
                           const cv::Mat& mask) {
  struct Guess {
    std::string sentence;
    Camera camera;
    cv::Mat mask;
  };
  const std::vector<Guess> guesses{
      {"the pictures look mirrored left to right", camera, flipped(mask, 1)},
      {"the pictures look upside down", camera, flipped(mask, 0)},
      {"the pictures look turned by half a turn", camera, flipped(mask, -1)},
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
    best = fmt::format("{} (so read, the IoU would be {:.2f})", guess.sentence, iou);
  }
  return best;
}

}  // namespace doppel
