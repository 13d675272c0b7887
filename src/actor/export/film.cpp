#include "doppel/actor/export/film.h"

#include <cmath>
#include <future>
#include <map>
#include <opencv2/imgproc.hpp>

#include "doppel/actor/draw.h"
#include "doppel/core/angles.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/tensor/image_tensor.h"
#include "doppel/data/capture/video_file.h"
#include "doppel/geometry/image_file.h"
#include "doppel/render/lighting/soft_light.h"
#include "doppel/render/projection.h"

namespace doppel {
namespace {

using Eigen::Vector3d;
using torch::Tensor;

constexpr double kGrey = 0.75;

class FilmWriter : public SequenceWriter {
 public:
  FilmWriter(const std::filesystem::path& folder, const Character& character, std::unique_ptr<CameraPath> path,
             const FilmOptions& options)
      : folder_(folder),
        mesh_(character.mesh),
        render_mesh_(character.mesh),
        camera_path_(std::move(path)),
        options_(options) {
    const int width = camera_path_->width(), height = camera_path_->height();
    if (!mesh_.texture.empty() && render_mesh_.has_uvs()) texture_ = texture_tensor(mesh_);
    cv::Mat behind(height, width, CV_8UC3,
                   cv::Scalar(options.backdrop.colour[0], options.backdrop.colour[1], options.backdrop.colour[2]));
    if (!options.backdrop.image.empty())
      behind = fit_backdrop(options.backdrop, width, height, camera_path_->name() == "turntable");
    behind_ = behind;
    std::filesystem::create_directories(folder);
    if (!options.video) return;
    const cv::Size size = options.beside ? with_image_beside(behind_, 0).size() : behind_.size();
    video_ = std::make_unique<VideoFile>(folder / (camera_path_->name() + ".mp4"), size, options.frames_per_second);
  }

  void write(const PosedFrame& frame) override {
    const PinholeCamera camera = camera_path_->at(frame_, frame.vertices);
    if (std::abs(winding_number(mesh_, frame.vertices, camera.centre())) > 0.5)
      fail(
          "filming {}: in frame {} the camera is inside the actor, at ({:.3g}, {:.3g}, {:.3g}) m; choose another "
          "camera, or check the units of the calibration",
          camera.name, frame_, camera.centre().x(), camera.centre().y(), camera.centre().z());
    keep(draw(frame, camera), frame_++);
  }

  void close() override {
    wait_for_files();
    if (frame_ > 0 && !seen_)
      log::warn("filming {}: the actor is not visible in any frame; do motion and camera use the same world?",
                camera_path_->name());
    if (video_) video_->close();
  }

 private:
  Profile& profile() { return options_.profile ? *options_.profile : unused_; }

  Appearance appearance(const PosedFrame& frame, const PinholeCamera& camera, const Tensor& projection) {
    const ProfileScope scope(profile(), "texture");
    if (options_.texture) return {options_.texture(frame.window.unsqueeze(0), projection[0], tensor_of(frame)), {}};
    // Without texture and light, only the silhouette would be visible.
    if (options_.light == Light::soft || !texture_.defined())
      return {texture_, soft_light(camera, texture_.defined() ? 1.0 : kGrey)};
    return {texture_, {}};
  }

  cv::Mat draw(const PosedFrame& frame, const PinholeCamera& camera) {
    torch::NoGradGuard no_grad;
    if (options_.field) return draw_field(frame, camera);
    const Tensor projection = projection_tensor({camera}).unsqueeze(0);
    const Appearance look = appearance(frame, camera, projection);
    const ProfileScope scope(profile(), "drawing");
    const SupersampledImage drawn = draw_filmed(render_mesh_, tensor_of(frame), look, projection, camera.height,
                                                camera.width, options_.supersampling);
    const cv::Mat image = image_over(drawn.image[0][0], drawn.alpha[0][0], behind_);
    seen_ = seen_ || drawn.alpha.gt(0).any().item<bool>();
    return image;
  }

  cv::Mat draw_field(const PosedFrame& frame, const PinholeCamera& camera) {
    const ProfileScope scope(profile(), options_.field_name);
    const FieldImage drawn = options_.field(frame.window.unsqueeze(0), projection_tensor({camera})[0], tensor_of(frame),
                                            camera.height, camera.width);
    seen_ = seen_ || drawn.opacity.gt(0).any().item<bool>();
    return image_over(drawn.colour, drawn.opacity, behind_);
  }

  cv::Mat with_image_beside(const cv::Mat& drawn, int frame) const {
    const cv::Mat other = options_.beside(frame);
    const double scale = static_cast<double>(drawn.rows) / other.rows;
    cv::Mat left, both;
    // An even width, which video codecs ask for.
    const int width = 2 * std::max(1, static_cast<int>(std::lround(0.5 * scale * other.cols)));
    cv::resize(other, left, {width, drawn.rows}, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    cv::hconcat(left, drawn, both);
    return both;
  }

  /// Writes a frame to the files while the next one is drawn.
  void keep(const cv::Mat& drawn, int frame) {
    wait_for_files();
    files_ = std::async(std::launch::async, [this, drawn, frame] {
      const cv::Mat image = options_.beside ? with_image_beside(drawn, frame) : drawn;
      if (video_) video_->write(image);
      if (options_.images) write_image(folder_ / fmt::format("{}_{:06}.png", camera_path_->name(), frame), image);
    });
  }

  /// @throws the error of the frame that was being written
  void wait_for_files() {
    const ProfileScope scope(profile(), "files");
    if (files_.valid()) files_.get();
  }

  std::filesystem::path folder_;
  TriangleMesh mesh_;
  RenderMesh render_mesh_;
  std::unique_ptr<CameraPath> camera_path_;
  FilmOptions options_;
  Tensor texture_;
  cv::Mat behind_;
  std::unique_ptr<VideoFile> video_;
  std::future<void> files_;  // after what it uses: its destructor waits
  Profile unused_;
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
  fail<UsageError>("'{}' is neither an image that exists nor a colour; colours: black white grey green blue #rrggbb",
                   text);
}

cv::Mat fit_backdrop(const Backdrop& backdrop, int width, int height, bool may_crop) {
  cv::Mat image = backdrop.image;
  const double ratio = (static_cast<double>(image.cols) / image.rows) / (static_cast<double>(width) / height);
  if (std::abs(ratio - 1.0) > 0.01) {
    if (!may_crop)
      fail<UsageError>(
          "{} has {} x {} pixels, the camera {} x {}: the background of a calibrated camera must have its aspect ratio",
          backdrop.name, image.cols, image.rows, width, height);
    const int columns = ratio > 1 ? static_cast<int>(std::lround(image.cols / ratio)) : image.cols;
    const int rows = ratio < 1 ? static_cast<int>(std::lround(image.rows * ratio)) : image.rows;
    image = image(cv::Rect((image.cols - columns) / 2, (image.rows - rows) / 2, columns, rows));
  }
  cv::Mat fitted;
  cv::resize(image, fitted, {width, height}, 0, 0, image.cols > width ? cv::INTER_AREA : cv::INTER_LINEAR);
  return fitted;
}

double winding_number(const TriangleMesh& mesh, std::span<const float> vertices, const Vector3d& point) {
  double sum = 0.0;
  for (const Triangle& face : mesh.faces) {
    std::array<Vector3d, 3> to;
    for (std::size_t i = 0; i < 3; ++i)
      to[i] = Eigen::Map<const Eigen::Vector3f>(&vertices[3 * face[i]]).cast<double>() - point;
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
