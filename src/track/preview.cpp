#include "doppel/track/preview.h"

#include <cstdlib>
#include <filesystem>
#include <opencv2/highgui.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/video_file.h"
#include "doppel/geometry/encoded_image.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr char kTitle[] = "doppel track";
constexpr double kTurn = 10.0;  // degrees per key press

void write_caption(cv::Mat& image, const std::string& caption) {
  const cv::Point position(10, image.rows - 12);
  cv::putText(image, caption, position, cv::FONT_HERSHEY_SIMPLEX, 0.5, {0, 0, 0}, 3, cv::LINE_AA);
  cv::putText(image, caption, position, cv::FONT_HERSHEY_SIMPLEX, 0.5, {255, 255, 255}, 1, cv::LINE_AA);
}

class FilmPreview : public Preview {
 public:
  FilmPreview(const fs::path& path, TrackView view, double frames_per_second)
      : view_(std::move(view)), video_(path, view_.size(), frames_per_second) {}

  bool show(const cv::Mat& image, const Eigen::Matrix3Xd& vertices, const std::string& caption) override {
    cv::Mat drawn = view_.draw(image, tensor_of_vertices(vertices));
    write_caption(drawn, caption);
    video_.write(drawn);
    return true;
  }
  bool wants_all() const override { return true; }
  void close() override { video_.close(); }

 private:
  TrackView view_;
  VideoFile video_;
};

class WindowPreview : public Preview {
 public:
  explicit WindowPreview(TrackView view) : view_(std::move(view)) {
    // The window library may end the process when there is no screen, so the screen is checked first.
    const bool screen = std::getenv("DISPLAY") || std::getenv("WAYLAND_DISPLAY");
    try {
      if (screen) cv::namedWindow(kTitle, cv::WINDOW_NORMAL | cv::WINDOW_KEEPRATIO);
    } catch (const cv::Exception& e) {
      fail<UsageError>("the preview window cannot be opened ({}); --preview FILE.mp4 needs no screen", e.what());
    }
    if (!screen) fail<UsageError>("there is no screen for the preview window; --preview FILE.mp4 needs none");
    cv::resizeWindow(kTitle, view_.size().width, view_.size().height);
  }
  WindowPreview(const WindowPreview&) = delete;
  WindowPreview& operator=(const WindowPreview&) = delete;
  ~WindowPreview() override { cv::destroyWindow(kTitle); }

  bool show(const cv::Mat& image, const Eigen::Matrix3Xd& vertices, const std::string& caption) override {
    cv::Mat drawn = view_.draw(image, tensor_of_vertices(vertices));
    write_caption(drawn, caption);
    cv::imshow(kTitle, drawn);
    return idle();
  }
  bool idle() override {
    const int key = cv::pollKey() & 0xff;
    if (key == 'a') view_.turn(-kTurn);
    if (key == 'd') view_.turn(kTurn);
    const bool closed = cv::getWindowProperty(kTitle, cv::WND_PROP_VISIBLE) < 1.0;
    return !(key == 'q' || key == 27 || closed);
  }
  bool wants_all() const override { return false; }

 private:
  TrackView view_;
};

}  // namespace

std::unique_ptr<Preview> open_preview(const std::string& target, const PinholeCamera& camera, const TriangleMesh& mesh,
                                      double frames_per_second, const TrackViewOptions& options) {
  TrackView view(camera, mesh, options);
  if (target == "window") return std::make_unique<WindowPreview>(std::move(view));
  const fs::path path(target);
  if (path.extension() != ".mp4") fail<UsageError>("--preview {}: neither `window` nor an .mp4 file", target);
  if (path.has_parent_path()) fs::create_directories(path.parent_path());
  return std::make_unique<FilmPreview>(path, std::move(view), frames_per_second);
}

cv::Mat read_texture(const std::string& path) {
  if (path.empty()) return {};
  const std::string bytes = fs::is_regular_file(path) ? read_file(path) : std::string();
  cv::Mat texture = decode_image(bytes, cv::IMREAD_UNCHANGED);
  if (texture.type() != CV_8UC4 && !texture.empty()) texture = decode_image(bytes, cv::IMREAD_COLOR);
  if (texture.empty())
    fail<UsageError>(
        "--texture {}: there is no image of this name that OpenCV can decode and that has at most {} pixels", path,
        kMaxImagePixels);
  return texture;
}

}  // namespace doppel
