#include "doppel/export/film.h"

#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/render/buffers.h"
#include "doppel/render/projection.h"
#include "doppel/render/sh_lighting.h"

namespace doppel {
namespace {

using Eigen::Vector3d;
using torch::Tensor;

constexpr double kPi = 3.14159265358979323846;
constexpr double kAmbient = 0.55, kKey = 0.5;    // shares of the light from everywhere and from the key
const Vector3d kKeyDirection(0.4, -0.8, -0.45);  // in the camera's axes: from above its right shoulder
constexpr double kGrey = 0.75;

/// Adds `strength` * max(0, n . d) in its first three bands (1/4 + 1/2 c + 5/32 (3 c^2 - 1), c = n . d) to coefficients
/// in the order of sh_basis.
void add_lambert(std::array<double, 9>& light, double strength, const Vector3d& d) {
  const double square = 5.0 / 32.0 * strength;
  light[0] += strength / 4;
  light[1] += strength / 2 * d.y();
  light[2] += strength / 2 * d.z();
  light[3] += strength / 2 * d.x();
  light[4] += 6 * square * d.x() * d.y();
  light[5] += 6 * square * d.y() * d.z();
  light[6] += square * (d.z() * d.z() - 0.5 * (d.x() * d.x() + d.y() * d.y()));
  light[7] += 6 * square * d.x() * d.z();
  light[8] += 1.5 * square * (d.x() * d.x() - d.y() * d.y());
}

/// A sky that is brighter above, and a key that goes with the camera. @return [1,1,3,9]
Tensor soft_light(const Camera& camera, double albedo) {
  std::array<double, 9> light{};
  light[0] = 0.75 * kAmbient;
  light[1] = 0.25 * kAmbient;
  add_lambert(light, kKey, camera.R.transpose() * kKeyDirection.normalized());
  Tensor coefficients = torch::empty({1, 1, 3, 9});
  for (int channel = 0; channel < 3; ++channel)
    for (int j = 0; j < 9; ++j) coefficients[0][0][channel][j] = albedo * light[static_cast<std::size_t>(j)];
  return coefficients;
}

/// [H,W,3] RGB 0..1 as 8-bit BGR.
cv::Mat to_picture(const Tensor& colour) {
  const Tensor bytes = (colour.clamp(0, 1) * 255 + 0.5).to(torch::kUInt8).flip(-1).contiguous();
  return cv::Mat(static_cast<int>(bytes.size(0)), static_cast<int>(bytes.size(1)), CV_8UC3, bytes.data_ptr()).clone();
}

Tensor from_picture(const cv::Mat& picture) {
  const cv::Mat whole = picture.isContinuous() ? picture : picture.clone();
  return torch::from_blob(whole.data, {whole.rows, whole.cols, 3}, torch::kUInt8).to(torch::kFloat32).flip(-1) / 255;
}

class FilmWriter : public SequenceWriter {
 public:
  FilmWriter(const std::filesystem::path& folder, const Character& character, std::unique_ptr<CameraPath> path,
             const FilmOptions& options)
      : folder_(folder),
        mesh_(character.mesh),
        render_mesh_(character.mesh),
        camera_path_(std::move(path)),
        options_(options),
        video_path_(folder / (camera_path_->name() + ".mp4")),
        temporary_(folder / ("." + camera_path_->name() + ".part.mp4")) {
    const int width = camera_path_->width(), height = camera_path_->height();
    if (!mesh_.texture.empty() && render_mesh_.has_uvs()) texture_ = texture_tensor(mesh_);
    cv::Mat behind(height, width, CV_8UC3,
                   cv::Scalar(options.backdrop.colour[0], options.backdrop.colour[1], options.backdrop.colour[2]));
    if (!options.backdrop.picture.empty())
      behind = fit_backdrop(options.backdrop, width, height, camera_path_->name() == "turntable");
    behind_ = from_picture(behind);
    std::filesystem::create_directories(folder);
    if (!options.video) return;
    video_.open(temporary_.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), options.frames_per_second,
                {width, height});
    if (!video_.isOpened())
      fail("opening {} for writing: this OpenCV build has no encoder for MPEG-4 video", video_path_.string());
  }
  ~FilmWriter() override {
    if (!video_.isOpened()) return;
    video_.release();
    std::error_code ignored;
    std::filesystem::remove(temporary_, ignored);
  }

  void write(const PosedFrame& frame) override {
    const float* vertices = frame.vertices;
    const Camera camera = camera_path_->at(frame_, vertices);
    if (std::abs(winding_number(mesh_, vertices, camera.centre())) > 0.5)
      fail(
          "filming {}: in frame {} the camera stands inside the actor, at ({:.3g}, {:.3g}, {:.3g}) m; choose another "
          "camera, or check the units of the calibration",
          camera.name, frame_, camera.centre().x(), camera.centre().y(), camera.centre().z());
    const cv::Mat picture = draw(frame, camera);
    if (options_.video) video_.write(picture);
    if (options_.pictures) write_picture(picture);
    ++frame_;
  }

  void close() override {
    if (frame_ > 0 && !seen_)
      log::warn("filming {}: the actor is in no frame of it; do motion and camera share one world?",
                camera_path_->name());
    if (!options_.video) return;
    video_.release();
    std::filesystem::rename(temporary_, video_path_);
  }

 private:
  cv::Mat draw(const PosedFrame& frame, const Camera& camera) {
    torch::NoGradGuard no_grad;
    RenderScene scene;
    scene.vertices = torch::from_blob(const_cast<float*>(frame.vertices), {1, mesh_.num_vertices(), 3});
    scene.projection = projection_tensor({camera}).unsqueeze(0);
    const bool dynamic = options_.actor && options_.actor->description().texture_size > 0;
    scene.texture =
        dynamic ? options_.actor->textured(frame.window.unsqueeze(0), scene.projection[0]).second : texture_;
    ShadingOptions shading;
    // Without a texture there would be nothing to see but an outline.
    shading.lit = !dynamic && (options_.light == Light::soft || !texture_.defined());
    if (shading.lit) scene.lighting = soft_light(camera, texture_.defined() ? 1.0 : kGrey);
    const SupersampledImage drawn = render_supersampled(scene, render_mesh_, camera.height, camera.width,
                                                        RenderMode::colour, options_.supersampling, shading);
    seen_ = seen_ || drawn.alpha.gt(0).any().item<bool>();
    return to_picture(drawn.over(behind_)[0][0]);
  }

  void write_picture(const cv::Mat& picture) const {
    const std::filesystem::path path = folder_ / fmt::format("{}_{:06}.png", camera_path_->name(), frame_);
    if (!cv::imwrite(path.string(), picture)) fail("the picture {} cannot be written", path.string());
  }

  std::filesystem::path folder_;
  TriangleMesh mesh_;
  RenderMesh render_mesh_;
  std::unique_ptr<CameraPath> camera_path_;
  FilmOptions options_;
  std::filesystem::path video_path_, temporary_;
  Tensor texture_, behind_;
  cv::VideoWriter video_;
  int frame_ = 0;
  bool seen_ = false;
};

}  // namespace

cv::Vec3b parse_colour(const std::string& text) {
  static const std::map<std::string, cv::Vec3b> words{{"black", {0, 0, 0}},
                                                      {"white", {255, 255, 255}},
                                                      {"grey", {128, 128, 128}},
                                                      {"green", {0, 177, 64}},
                                                      {"blue", {187, 71, 0}}};
  if (const auto word = words.find(text); word != words.end()) return word->second;
  if (text.size() == 7 && text[0] == '#' && text.find_first_not_of("0123456789abcdefABCDEF", 1) == std::string::npos) {
    const unsigned long rgb = std::stoul(text.substr(1), nullptr, 16);
    return {static_cast<uchar>(rgb & 255), static_cast<uchar>(rgb >> 8 & 255), static_cast<uchar>(rgb >> 16)};
  }
  fail<UsageError>("'{}' is neither a picture that exists nor a colour; colours: black white grey green blue #rrggbb",
                   text);
}

cv::Mat fit_backdrop(const Backdrop& backdrop, int width, int height, bool may_crop) {
  cv::Mat picture = backdrop.picture;
  const double ratio = (static_cast<double>(picture.cols) / picture.rows) / (static_cast<double>(width) / height);
  if (std::abs(ratio - 1.0) > 0.01) {
    if (!may_crop)
      fail<UsageError>(
          "{} has {} x {} pixels, the camera {} x {}: a picture behind a calibrated camera must have its proportions",
          backdrop.name, picture.cols, picture.rows, width, height);
    const int columns = ratio > 1 ? static_cast<int>(std::lround(picture.cols / ratio)) : picture.cols;
    const int rows = ratio < 1 ? static_cast<int>(std::lround(picture.rows * ratio)) : picture.rows;
    picture = picture(cv::Rect((picture.cols - columns) / 2, (picture.rows - rows) / 2, columns, rows));
  }
  cv::Mat fitted;
  cv::resize(picture, fitted, {width, height}, 0, 0, picture.cols > width ? cv::INTER_AREA : cv::INTER_LINEAR);
  return fitted;
}

double winding_number(const TriangleMesh& mesh, const float* vertices, const Vector3d& point) {
  double sum = 0.0;
  for (const Triangle& face : mesh.faces) {
    std::array<Vector3d, 3> to;
    for (std::size_t i = 0; i < 3; ++i)
      to[i] = Eigen::Map<const Eigen::Vector3f>(vertices + 3 * face[i]).cast<double>() - point;
    const double a = to[0].norm(), b = to[1].norm(), c = to[2].norm();
    sum += std::atan2(to[0].dot(to[1].cross(to[2])),
                      a * b * c + to[0].dot(to[1]) * c + to[1].dot(to[2]) * a + to[2].dot(to[0]) * b);
  }
  return sum / (2 * kPi);
}

std::unique_ptr<SequenceWriter> make_film_writer(const std::filesystem::path& folder, const Character& character,
                                                 std::unique_ptr<CameraPath> path, const FilmOptions& options) {
  return std::make_unique<FilmWriter>(folder, character, std::move(path), options);
}

}  // namespace doppel
