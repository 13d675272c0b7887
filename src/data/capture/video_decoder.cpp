#include "doppel/data/capture/video_decoder.h"

#include <cmath>
#include <filesystem>
#include <opencv2/core/version.hpp>
#include <opencv2/videoio/registry.hpp>

#include "doppel/core/error.h"

namespace doppel {

namespace {

/// Prefers FFmpeg. Other backends print messages about unknown files, and they number frames differently.
int backend() {
  static const bool has_ffmpeg = cv::videoio_registry::hasBackend(cv::CAP_FFMPEG);
  return has_ffmpeg ? cv::CAP_FFMPEG : cv::CAP_ANY;
}

/// OpenCV states how far the stored image is turned clockwise to be shown; 4.6 alone states it counter-clockwise, and
/// therefore turns images of portrait videos upside down (opencv/opencv#22088).
constexpr bool kStatedCounterClockwise = CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR == 6;

/// Takes the turn over from OpenCV. @return quarter turns clockwise, 0 to 3
int take_turn(cv::VideoCapture& video, const std::string& path) {
  if (!video.set(cv::CAP_PROP_ORIENTATION_AUTO, 0)) return 0;  // this backend knows no turns
  const double stated = video.get(cv::CAP_PROP_ORIENTATION_META);
  const double clockwise = std::fmod((kStatedCounterClockwise ? -stated : stated) + 720.0, 360.0);
  const double quarters = std::round(clockwise / 90.0);
  if (std::abs(clockwise - 90.0 * quarters) > 2.0)
    fail_at({path, 0},
            "the metadata of the video turn it by {} degrees; quarter turns are allowed. `ffmpeg -i {} NEW` writes a "
            "video that is turned",
            clockwise, path);
  return static_cast<int>(quarters) % 4;
}

}  // namespace

VideoDecoder::VideoDecoder(std::string path) : path_(std::move(path)) {
  if (!std::filesystem::is_regular_file(path_)) fail_at({path_, 0}, "the video does not exist");
  bool opened = false;
  try {
    opened = video_.open(path_, backend());
  } catch (const cv::Exception&) {
    // For a file that no backend can read, OpenCV may throw an exception instead of returning false.
  }
  if (opened) quarters_ = take_turn(video_, path_);
  const cv::Size pixels = opened ? size() : cv::Size();
  if (pixels.width <= 0 || pixels.height <= 0)
    fail_at({path_, 0}, "is no video that OpenCV can decode; it may be truncated, empty or in an unknown format");
}

bool VideoDecoder::skip() { return video_.grab(); }

cv::Mat VideoDecoder::read() {
  cv::Mat stored;
  if (!video_.read(stored) || stored.empty()) return {};
  if (quarters_ == 0) return stored.clone();
  constexpr cv::RotateFlags kTurns[] = {cv::ROTATE_90_CLOCKWISE, cv::ROTATE_180, cv::ROTATE_90_COUNTERCLOCKWISE};
  cv::Mat shown;
  cv::rotate(stored, shown, kTurns[quarters_ - 1]);
  return shown;
}

void VideoDecoder::seek(long frame) { video_.set(cv::CAP_PROP_POS_FRAMES, static_cast<double>(frame)); }

cv::Size VideoDecoder::size() const {
  const int width = static_cast<int>(video_.get(cv::CAP_PROP_FRAME_WIDTH)),
            height = static_cast<int>(video_.get(cv::CAP_PROP_FRAME_HEIGHT));
  return quarters_ % 2 == 0 ? cv::Size(width, height) : cv::Size(height, width);
}

double VideoDecoder::frames_per_second() const {
  const double stated = video_.get(cv::CAP_PROP_FPS);
  return std::isfinite(stated) && stated > 0.0 ? stated : 0.0;
}

long VideoDecoder::stated_frames() const { return static_cast<long>(video_.get(cv::CAP_PROP_FRAME_COUNT)); }

double VideoDecoder::seconds() const { return 1e-3 * video_.get(cv::CAP_PROP_POS_MSEC); }

}  // namespace doppel
