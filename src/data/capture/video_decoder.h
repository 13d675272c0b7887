#pragma once

#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <string>

namespace doppel {

/// Decodes a video file frame by frame. Images are turned as the metadata of the file say, as every player does.
class VideoDecoder {
 public:
  /// @throws FileError when the file is missing, is no video that OpenCV can decode, or is to be turned by other than
  /// quarter turns
  explicit VideoDecoder(std::string path);

  /// Passes over a frame. @return false at the end
  bool skip();
  /// The next image, BGR, in memory of its own; an empty one at the end.
  cv::Mat read();
  /// Goes to a frame, or near it: many containers have no index of their frames.
  void seek(long frame);

  /// Size of the images, as shown.
  cv::Size size() const;
  /// 0 where the file does not state it.
  double frames_per_second() const;
  /// As the header says, which may be an estimate.
  long stated_frames() const;
  /// The time stamp of the image that was read last.
  double seconds() const;

 private:
  std::string path_;
  cv::VideoCapture video_;
  int quarters_ = 0;  ///< turns clockwise from the stored image to the shown one, 0 to 3
};

}  // namespace doppel
