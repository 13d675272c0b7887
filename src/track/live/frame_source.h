#pragma once

/// Sources of live images: a camera, or files that are played like a camera.

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <string>

#include "doppel/core/clock.h"

namespace doppel {

/// An image from a source.
struct SourceImage {
  long number = 0;          ///< counts all images of the source from 0, including images that are dropped later
  long frame = 0;           ///< index in the file, from 0; for a camera the same as `number`
  cv::Mat image;            ///< 8-bit BGR, with lens distortion
  Clock::time_point taken;  ///< time of arrival
};

/// Images of one camera, one after the other. Used on one thread at a time.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Waits for the next image. @return nothing at the end, or soon after a stop was requested (`stop_requested`)
  /// @throws FileError for an image that cannot be decoded
  virtual std::optional<SourceImage> next() = 0;
  /// Whether images arrive at their own rate, so that an image that is not taken in time is lost.
  virtual bool live() const = 0;
  virtual cv::Size size() const = 0;
  virtual double frames_per_second() const = 0;
  /// A description for messages.
  virtual const std::string& name() const = 0;
};

struct SourceOptions {
  bool live = false;                ///< play a file at its own rate, like a camera
  int repeat = 1;                   ///< how often a file is played
  double frames_per_second = 25.0;  ///< of a folder of images, and of a source of unknown rate
};

/// A camera. One that falls silent, say because its cable was pulled, is opened again and again.
struct Device {
  std::string name;  ///< for messages
  std::function<bool(cv::VideoCapture&)> open;
  double frames_per_second = 25.0;  ///< where the camera states none
  double silence = 1.0;             ///< seconds without an image after which it is opened again
  double patience = 60.0;           ///< seconds without an image after which the source ends
};
/// Its images, all of the first one's size. @throws UsageError when it cannot be opened
std::unique_ptr<FrameSource> open_device(Device device);

/// Whether a source is the number of a camera.
bool is_camera(const std::string& source);
/// @param source the number of a camera (0: the first), a video file, or a folder of images in the natural order of
/// their names
/// @throws UsageError when it is none of these, or a camera cannot be opened
std::unique_ptr<FrameSource> open_source(const std::string& source, const SourceOptions& options = {});

}  // namespace doppel
