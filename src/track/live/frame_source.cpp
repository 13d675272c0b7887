#include "doppel/track/live/frame_source.h"

#include <algorithm>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <thread>
#include <vector>

#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/data/capture/video_decoder.h"
#include "doppel/detect/keypoints/frame_names.h"
#include "doppel/geometry/image_file.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

using Seconds = std::chrono::duration<double>;

constexpr Seconds kNap{0.02};  // between two checks for work

/// Waits unless a stop is requested. @return false for a stop
bool sleep_until(Clock::time_point time) {
  while (!stop_requested() && Clock::now() < time)
    std::this_thread::sleep_for(std::min<Seconds>(kNap, time - Clock::now()));
  return !stop_requested();
}

class DeviceSource : public FrameSource {
 public:
  explicit DeviceSource(Device device) : device_(std::move(device)) {
    if (!device_.open(video_)) fail<UsageError>("{}: no such camera, or another program uses it", device_.name);
    const double stated = video_.get(cv::CAP_PROP_FPS);
    if (stated > 0.0) device_.frames_per_second = stated;
    size_ = {static_cast<int>(video_.get(cv::CAP_PROP_FRAME_WIDTH)),
             static_cast<int>(video_.get(cv::CAP_PROP_FRAME_HEIGHT))};
  }

  std::optional<SourceImage> next() override {
    const auto start = Clock::now();
    auto opened = start;
    while (!stop_requested()) {
      cv::Mat image;
      if (video_.read(image) && image.size() == size_) {
        const long number = count_++;
        return SourceImage{number, number, image.clone(), Clock::now()};
      }
      if (seconds_since(start) > device_.patience) {
        log::warn("{}: no image of {} x {} pixels for {:.0f} seconds; it seems to be disconnected", device_.name,
                  size_.width, size_.height, device_.patience);
        return std::nullopt;
      }
      if (seconds_since(opened) > device_.silence) {
        log::warn("{}: no image; opening it again", device_.name);
        device_.open(video_);
        opened = Clock::now();
      }
      std::this_thread::sleep_for(kNap);
    }
    return std::nullopt;
  }
  bool live() const override { return true; }
  cv::Size size() const override { return size_; }
  double frames_per_second() const override { return device_.frames_per_second; }
  const std::string& name() const override { return device_.name; }

 private:
  Device device_;
  cv::VideoCapture video_;
  cv::Size size_;
  long count_ = 0;
};

/// Images on disk in order; can be read from the start again.
class Reel {
 public:
  virtual ~Reel() = default;
  /// The next image, or an empty one at the end.
  virtual cv::Mat next() = 0;
  virtual void rewind() = 0;
  virtual cv::Size size() const = 0;
  /// 0 where the file does not state it.
  virtual double frames_per_second() const = 0;
};

class VideoReel : public Reel {
 public:
  explicit VideoReel(const std::string& path) : path_(path), video_(path) {}

  cv::Mat next() override { return video_.read(); }
  void rewind() override { video_ = VideoDecoder(path_); }
  cv::Size size() const override { return video_.size(); }
  double frames_per_second() const override { return video_.frames_per_second(); }

 private:
  std::string path_;
  VideoDecoder video_;
};

class FolderReel : public Reel {
 public:
  explicit FolderReel(const fs::path& folder) {
    std::vector<std::string> images;
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.is_regular_file() && cv::haveImageReader(entry.path().string()))
        images.push_back(entry.path().string());
    if (images.empty()) fail_at({folder.string(), 0}, "holds no image that OpenCV can decode");
    for (const std::size_t i : order_of_names(images)) paths_.emplace_back(images[i]);
    size_ = read_colour_image(paths_.front()).size();
  }

  cv::Mat next() override {
    if (next_ == paths_.size()) return {};
    const fs::path& path = paths_[next_++];
    cv::Mat image = read_colour_image(path);
    if (image.size() != size_)
      fail_at({path.string(), 0}, "has {} x {} pixels, the first image of the folder {} x {}; they must be equal",
              image.cols, image.rows, size_.width, size_.height);
    return image;
  }
  void rewind() override { next_ = 0; }
  cv::Size size() const override { return size_; }
  double frames_per_second() const override { return 0.0; }

 private:
  std::vector<fs::path> paths_;
  std::size_t next_ = 0;
  cv::Size size_;
};

class ReelSource : public FrameSource {
 public:
  ReelSource(std::unique_ptr<Reel> reel, std::string name, const SourceOptions& options)
      : reel_(std::move(reel)), name_(std::move(name)), options_(options) {
    const double stated = reel_->frames_per_second();
    if (stated > 0.0) options_.frames_per_second = stated;
  }

  std::optional<SourceImage> next() override {
    if (options_.live && !wait_for_its_time()) return std::nullopt;
    cv::Mat image = stop_requested() ? cv::Mat() : reel_->next();
    if (image.empty() && frame_ > 0 && ++played_ < options_.repeat && !stop_requested()) {
      reel_->rewind();
      frame_ = 0;
      image = reel_->next();
    }
    if (image.empty()) return std::nullopt;
    return SourceImage{number_++, frame_++, std::move(image), Clock::now()};
  }
  bool live() const override { return options_.live; }
  cv::Size size() const override { return reel_->size(); }
  double frames_per_second() const override { return options_.frames_per_second; }
  const std::string& name() const override { return name_; }

 private:
  bool wait_for_its_time() {
    if (number_ == 0) start_ = Clock::now();
    const Seconds since_start(static_cast<double>(number_) / options_.frames_per_second);
    return sleep_until(start_ + std::chrono::duration_cast<Clock::duration>(since_start));
  }

  std::unique_ptr<Reel> reel_;
  std::string name_;
  SourceOptions options_;
  long number_ = 0, frame_ = 0;
  int played_ = 0;
  Clock::time_point start_;
};

}  // namespace

bool is_camera(const std::string& source) {
  return !source.empty() && source.size() < 4 && source.find_first_not_of("0123456789") == std::string::npos;
}

std::unique_ptr<FrameSource> open_device(Device device) { return std::make_unique<DeviceSource>(std::move(device)); }

std::unique_ptr<FrameSource> open_source(const std::string& source, const SourceOptions& options) {
  if (is_camera(source)) {
    const int index = std::stoi(source);
    return open_device({"camera " + source, [index](cv::VideoCapture& video) { return video.open(index); },
                        options.frames_per_second});
  }
  if (fs::is_directory(source))
    return std::make_unique<ReelSource>(std::make_unique<FolderReel>(source), source, options);
  if (fs::is_regular_file(source))
    return std::make_unique<ReelSource>(std::make_unique<VideoReel>(source), source, options);
  fail<UsageError>("--source {}: neither the number of a camera nor a video file nor a folder of images", source);
}

}  // namespace doppel
