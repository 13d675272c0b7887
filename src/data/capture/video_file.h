#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

namespace doppel {

/// Ends the writing of a video. OpenCV does not report a write that failed, for instance on a full disk, so the file is
/// opened again.
/// @param frames number of images that were written @throws Error when the file does not hold as many
void finish_video(cv::VideoWriter& writer, const std::filesystem::path& file, long frames);

/// An MP4 file that is written to a temporary file and renamed when it is complete.
class VideoFile {
 public:
  /// @param size of the images; both sides even
  /// @throws Error when OpenCV has no encoder, or the file cannot be made
  VideoFile(const std::filesystem::path& path, cv::Size size, double frames_per_second);
  /// Removes the temporary file unless `close` has renamed it.
  ~VideoFile();
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  /// @param image 8-bit BGR of the given size
  void write(const cv::Mat& image);
  /// @throws Error when not all images could be written
  void close();

 private:
  void discard();
  std::filesystem::path path_, temporary_;
  cv::VideoWriter writer_;
  long frames_ = 0;
};

}  // namespace doppel
