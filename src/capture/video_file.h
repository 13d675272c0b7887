#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

namespace doppel {

/// An MP4 file that is written to a temporary file and renamed when it is complete.
class VideoFile {
 public:
  /// @param size of the images; both sides even
  /// @throws Error when OpenCV has no encoder
  VideoFile(const std::filesystem::path& path, cv::Size size, double frames_per_second);
  /// Removes the temporary file if `close` was not called.
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
