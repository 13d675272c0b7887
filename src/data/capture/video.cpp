#include "doppel/data/capture/video.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/layouts/file_stream.h"
#include "doppel/data/capture/video_decoder.h"
#include "doppel/detect/keypoints/frame_names.h"
#include "doppel/geometry/image_file.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr int kAlphaSamples = 20;

cv::Mat alpha_of(const cv::Mat& image) {
  cv::Mat alpha;
  cv::extractChannel(image, alpha, 3);
  return alpha;
}

/// Whether an image has an alpha channel that tells pixels apart.
bool has_varied_alpha(const cv::Mat& image) {
  if (image.channels() != 4) return false;
  double lowest = 0.0, highest = 0.0;
  cv::minMaxLoc(alpha_of(image), &lowest, &highest);
  return lowest < highest;
}

/// Brightness. What is not black does not become black, neither the label 1 of 16 bits nor a dark blue.
cv::Mat to_mask(const cv::Mat& image) {
  cv::Mat grey = image, bytes;
  if (image.channels() != 1) {
    cv::Mat black;
    cv::cvtColor(image, grey, image.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
    cv::inRange(image, cv::Scalar::all(0), cv::Scalar(0, 0, 0, 65535), black);
    grey.setTo(1, (grey == 0) & ~black);
  }
  if (grey.depth() != CV_16U) return grey;
  grey.convertTo(bytes, CV_8U, 1.0 / 257.0, 0.498);  // rounded up
  return bytes;
}

/// Converts an image to 8 bits and the requested number of channels; `source` and `frame` are for messages.
cv::Mat convert(const cv::Mat& image, PixelFormat format, const std::string& source, long frame) {
  if (image.depth() != CV_8U && image.depth() != CV_16U)
    fail_at({source, 0}, "frame {} has neither 8 nor 16 bits per channel", frame);
  if (format == PixelFormat::mask) return to_mask(image);
  const cv::Mat colour = to_colour(image);
  if (format == PixelFormat::colour) return colour;
  cv::Mat grey;
  cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

/// Some elements, at most `most`, from the whole list.
std::vector<long> evenly_chosen(const std::vector<long>& all, int most) {
  if (all.size() <= as_size(most)) return all;
  std::vector<long> chosen;
  for (std::size_t i = 0; i < as_size(most); ++i) chosen.push_back(all[(2 * i + 1) * all.size() / (2 * as_size(most))]);
  return chosen;
}

/// By the extension, as the files of a capture are sorted.
bool is_image_name(const fs::path& path) { return kind_of_file(path.string()) == FileKind::image; }

class VideoReader : public FrameReader {
 public:
  VideoReader(std::string source, PixelFormat format) : source_(std::move(source)), format_(format), video_(source_) {}

  cv::Mat read(long frame) override {
    if (frame == next_ - 1 && !last_.empty()) return last_;
    if (frame < next_) fail("internal: frame {} of {} requested after frame {}", frame, source_, next_ - 1);
    while (next_ < frame) {
      if (!video_.skip()) fail_missing(frame);
      ++next_;
    }
    const cv::Mat image = video_.read();
    if (image.empty()) fail_missing(frame);
    ++next_;
    last_ = convert(image, format_, source_, frame);
    return last_;
  }

  cv::Size size() override { return video_.size(); }

  long num_frames(long expected) override {
    const long stated = video_.stated_frames();
    if (stated == expected) return stated;
    // Headers contain only estimates in many containers, so the frames are counted.
    VideoDecoder counter(source_);
    long count = 0;
    while (counter.skip()) ++count;
    if (count == 0) fail_missing(0);
    return count;
  }

  const std::string& source() const override { return source_; }

  std::optional<double> seconds() const override { return video_.seconds(); }

  std::vector<cv::Mat> samples(int most) override {
    VideoDecoder video(source_);
    std::vector<cv::Mat> images;
    const long frames = std::max(1L, video.stated_frames());
    for (long i = 0; i < std::min<long>(most, frames); ++i) {
      if (i > 0) video.seek(i * frames / std::min<long>(most, frames));
      const cv::Mat image = video.read();
      if (!image.empty()) images.push_back(convert(image, format_, source_, i));
    }
    return images;
  }

 private:
  [[noreturn]] void fail_missing(long frame) const {
    fail_at({source_, 0}, "frame {} cannot be read: the video ends, or is damaged, after {} frames", frame, next_);
  }

  std::string source_;
  PixelFormat format_;
  VideoDecoder video_;
  cv::Mat last_;  ///< image of frame next_ - 1
  long next_ = 0;
};

class ImageReader : public FrameReader {
 public:
  /// @param pattern with `{frame}`, or a folder: then the frames are the positions of its images in natural order
  ImageReader(std::string pattern, PixelFormat format) : pattern_(std::move(pattern)), format_(format) {
    if (fs::is_directory(pattern_))
      list_folder();
    else
      frames_ = frames_of_pattern(pattern_);
    if (frames_.empty()) fail_at({pattern_, 0}, "no image matches this pattern, or lies in this folder");
  }

  cv::Mat read(long frame) override {
    const std::string path = path_of(frame);
    if (!fs::is_regular_file(path)) fail_at({path, 0}, "the image of frame {} does not exist", frame);
    const cv::Mat image = read_image(path);
    return convert(is_mask_in_alpha(image) ? alpha_of(image) : image, format_, path, frame);
  }

  cv::Size size() override { return read(frames_.front()).size(); }
  long num_frames(long) override { return frames_.back() + 1; }
  const std::string& source() const override { return pattern_; }

  std::vector<cv::Mat> samples(int most) override {
    std::vector<cv::Mat> images;
    for (const long frame : evenly_chosen(frames_, most)) images.push_back(read(frame));
    return images;
  }

 private:
  std::string path_of(long frame) const {
    if (paths_.empty()) return expand_pattern(pattern_, 0, "", frame);
    if (frame < 0 || as_size(frame) >= paths_.size())
      fail_at({pattern_, 0}, "the image of frame {} does not exist; the folder has {} images", frame, paths_.size());
    return paths_[as_size(frame)];
  }

  void list_folder() {
    std::vector<std::string> images;
    for (const auto& entry : fs::directory_iterator(pattern_))
      if (entry.is_regular_file() && is_image_name(entry.path())) images.push_back(entry.path().string());
    for (const std::size_t i : order_of_names(images)) {
      frames_.push_back(static_cast<long>(paths_.size()));
      paths_.push_back(images[i]);
    }
  }

  /// Where the alpha channels of some masks vary, they are the masks. A channel that does not is then a frame without
  /// the person, or full of it.
  bool is_mask_in_alpha(const cv::Mat& image) {
    if (format_ != PixelFormat::mask || image.channels() != 4) return false;
    if (has_varied_alpha(image)) return true;
    if (!alpha_varies_) {
      const std::vector<long> some = evenly_chosen(frames_, kAlphaSamples);
      alpha_varies_ = std::any_of(some.begin(), some.end(),
                                  [&](long frame) { return has_varied_alpha(read_image(path_of(frame))); });
    }
    return *alpha_varies_;
  }

  std::string pattern_;
  PixelFormat format_;
  std::vector<long> frames_;
  std::vector<std::string> paths_;    ///< of a folder, by frame
  std::optional<bool> alpha_varies_;  ///< in some of the images; nothing: they have not been looked at
};

}  // namespace

FootageFacts inspect_footage(const std::string& path) {
  if (fs::is_regular_file(path) && cv::haveImageReader(path)) {
    const cv::Size pixels = read_image(path).size();
    return {pixels.width, pixels.height, 0.0, 1};
  }
  const VideoDecoder video(path);
  return {video.size().width, video.size().height, video.frames_per_second(), video.stated_frames()};
}

std::unique_ptr<FrameReader> open_frames(const std::string& source, PixelFormat format) {
  if (has_frame_placeholder(source) || fs::is_directory(source)) return std::make_unique<ImageReader>(source, format);
  return std::make_unique<VideoReader>(source, format);
}

}  // namespace doppel
