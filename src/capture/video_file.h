#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

namespace doppel {

/// An MP4 that is written beside its place and put there when it is complete.
class VideoFile {
 public:
  /// @param size of the images, even sides @throws Error when OpenCV has no encoder
  VideoFile(const std::filesystem::path& path, cv::Size size, double frames_per_second);
  /// Removes what was not completed.
  ~VideoFile();
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  /// @param image 8-bit BGR of the given size
  void write(const cv::Mat& image);
  void close();

 private:
  std::filesystem::path path_, temporary_;
  cv::VideoWriter writer_;
};

}  // namespace doppel
