#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/video.h"
#include "doppel/geometry/camera.h"
#include "doppel/geometry/undistorter.h"

namespace doppel {

/// The whole images of one camera, without lens distortion, read from the videos or image files of the capture. A
/// prepared store holds crops only, so these files must still exist.
class WholeFrames {
 public:
  /// @param camera name and resolution of the images, as in Dataset::cameras()
  /// @throws Error when the calibration file has no camera of this name; FileError as read_calibration
  WholeFrames(const Capture& capture, const PinholeCamera& camera);

  /// The image of a frame. The files of a sequence are opened once as long as its frames are read in ascending order;
  /// an earlier frame or another sequence opens its files again.
  /// @param sequence name @param frame row of the motion
  /// @return 8-bit BGR of the camera's size; it may share memory with the reader until the next call
  /// @throws UsageError for an unknown sequence; FileError when the file or the frame is missing or cannot be decoded;
  /// Error for an image of another size
  cv::Mat read(const std::string& sequence, long frame);

 private:
  /// @param calibrated the camera with its distortion, and its position in the calibration file
  WholeFrames(const Capture& capture, const std::pair<Camera, int>& calibrated);
  void open(const std::string& sequence);

  Capture capture_;
  int file_index_;  ///< position of the camera in the calibration file
  Undistorter undistorter_;
  std::string sequence_;  ///< of `reader_`
  FrameClock clock_;      ///< of this sequence
  long last_ = 0;         ///< the video frame that was read last
  std::unique_ptr<FrameReader> reader_;
};

}  // namespace doppel
