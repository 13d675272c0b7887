#include "doppel/data/capture/video.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>

#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// Converts an image to 8 bits and the requested number of channels; `source` and `frame` are for messages.
cv::Mat convert(const cv::Mat& image, PixelFormat format, const std::string& source, long frame) {
  cv::Mat bytes = image;
  if (image.depth() == CV_16U)
    image.convertTo(bytes, CV_8U, 1.0 / 257.0);
  else if (image.depth() != CV_8U)
    fail_at({source, 0}, "frame {} has neither 8 nor 16 bits per channel", frame);
  cv::Mat result;
  const int channels = bytes.channels();
  if (format == PixelFormat::grey && channels != 1)
    cv::cvtColor(bytes, result, channels == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  else if (format == PixelFormat::colour && channels != 3)
    cv::cvtColor(bytes, result, channels == 4 ? cv::COLOR_BGRA2BGR : cv::COLOR_GRAY2BGR);
  else
    result = bytes;
  return result;
}

/// Prefers FFmpeg. Other backends print messages about unknown files, and they number frames differently.
int backend() {
  static const bool has_ffmpeg = cv::videoio_registry::hasBackend(cv::CAP_FFMPEG);
  return has_ffmpeg ? cv::CAP_FFMPEG : cv::CAP_ANY;
}

class VideoReader : public FrameReader {
 public:
  VideoReader(std::string source, PixelFormat format) : source_(std::move(source)), format_(format) {
    if (!fs::is_regular_file(source_)) fail_at({source_, 0}, "the video does not exist");
    open();
  }

  cv::Mat read(long frame) override {
    if (frame == next_ - 1 && !last_.empty()) return last_;
    if (frame < next_) fail("internal: frame {} of {} requested after frame {}", frame, source_, next_ - 1);
    while (next_ < frame) {
      if (!video_.grab()) fail_missing(frame);
      ++next_;
    }
    cv::Mat image;
    if (!video_.read(image) || image.empty()) fail_missing(frame);
    ++next_;
    last_ = convert(image, format_, source_, frame);
    return last_;
  }

  cv::Size size() override {
    return {static_cast<int>(video_.get(cv::CAP_PROP_FRAME_WIDTH)),
            static_cast<int>(video_.get(cv::CAP_PROP_FRAME_HEIGHT))};
  }

  FootageFacts facts() {
    const double fps = video_.get(cv::CAP_PROP_FPS);
    const cv::Size pixels = size();
    return {pixels.width, pixels.height, std::isfinite(fps) && fps > 0.0 ? fps : 0.0,
            static_cast<long>(video_.get(cv::CAP_PROP_FRAME_COUNT))};
  }

  long num_frames(long expected) override {
    const auto stated = static_cast<long>(video_.get(cv::CAP_PROP_FRAME_COUNT));
    if (stated == expected) return stated;
    // Headers contain only estimates in many containers, so the frames are counted.
    cv::VideoCapture counter(source_, backend());
    long count = 0;
    while (counter.grab()) ++count;
    if (count == 0) fail_missing(0);
    return count;
  }

  const std::string& source() const override { return source_; }

  std::optional<double> seconds() const override { return 1e-3 * video_.get(cv::CAP_PROP_POS_MSEC); }

 private:
  void open() {
    bool opened = false;
    try {
      opened = video_.open(source_, backend());
    } catch (const cv::Exception&) {
      // For a file that no backend can read, OpenCV may throw an exception instead of returning false.
    }
    const cv::Size pixels = opened ? size() : cv::Size();
    if (!opened || pixels.width <= 0 || pixels.height <= 0)
      fail_at({source_, 0}, "is no video that OpenCV can decode; it may be truncated, empty or in an unknown format");
  }

  [[noreturn]] void fail_missing(long frame) const {
    fail_at({source_, 0}, "frame {} cannot be read: the video ends, or is damaged, after {} frames", frame, next_);
  }

  std::string source_;
  PixelFormat format_;
  cv::VideoCapture video_;
  cv::Mat last_;  ///< image of frame next_ - 1
  long next_ = 0;
};

/// The image as stored: any number of channels and bits. @throws FileError where OpenCV cannot decode the file
cv::Mat read_image(const std::string& path) {
  cv::Mat image;
  try {
    image = cv::imread(path, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) fail_at({path, 0}, "is not an image that OpenCV can decode");
  return image;
}

class ImageReader : public FrameReader {
 public:
  ImageReader(std::string pattern, PixelFormat format) : pattern_(std::move(pattern)), format_(format) {
    list_frames();
    if (frames_.empty()) fail_at({pattern_, 0}, "no image matches this pattern");
  }

  cv::Mat read(long frame) override {
    const std::string path = expand_pattern(pattern_, 0, "", frame);
    if (!fs::is_regular_file(path)) fail_at({path, 0}, "the image of frame {} does not exist", frame);
    return convert(read_image(path), format_, path, frame);
  }

  cv::Size size() override { return read(frames_.front()).size(); }
  long num_frames(long) override { return frames_.back() + 1; }
  const std::string& source() const override { return pattern_; }

 private:
  /// Finds the frame numbers by listing the folder. The part of a file name at {frame} must be a number that expands to
  /// the same name.
  void list_frames() {
    const fs::path path(pattern_);
    const std::string name = path.filename().string();
    const std::size_t open = name.find("{frame");
    if (open == std::string::npos) {  // {frame} is in a folder's name: probe instead of listing
      for (long frame = 0; fs::is_regular_file(expand_pattern(pattern_, 0, "", frame)); ++frame)
        frames_.push_back(frame);
      return;
    }
    if (!fs::is_directory(path.parent_path())) return;
    const std::string before = name.substr(0, open);
    for (const auto& entry : fs::directory_iterator(path.parent_path())) {
      const std::string file = entry.path().filename().string();
      if (file.compare(0, before.size(), before) != 0) continue;
      std::size_t digits = before.size();
      while (digits < file.size() && std::isdigit(static_cast<unsigned char>(file[digits]))) ++digits;
      if (digits == before.size() || digits - before.size() > 18) continue;
      const long frame = std::stol(file.substr(before.size(), digits - before.size()));
      if (expand_pattern(name, 0, "", frame) == file) frames_.push_back(frame);
    }
    std::sort(frames_.begin(), frames_.end());
  }

  std::string pattern_;
  PixelFormat format_;
  std::vector<long> frames_;
};

FootageFacts inspect_image(const std::string& path) {
  const cv::Mat image = read_image(path);
  return {image.cols, image.rows, 0.0, 1};
}

}  // namespace

FootageFacts inspect_footage(const std::string& path) {
  if (fs::is_regular_file(path) && cv::haveImageReader(path)) return inspect_image(path);
  VideoReader video(path, PixelFormat::colour);
  return video.facts();
}

std::unique_ptr<FrameReader> open_frames(const std::string& source, PixelFormat format) {
  if (has_frame_placeholder(source)) return std::make_unique<ImageReader>(source, format);
  return std::make_unique<VideoReader>(source, format);
}

}  // namespace doppel
