#pragma once

/// Where live images come from: a camera, or a file that is read as if it were one.

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "doppel/core/clock.h"

namespace doppel {

/// An image as it came.
struct SourceImage {
  long number = 0;          ///< counts what came, from 0, what was dropped later included
  long frame = 0;           ///< its place in the file, from 0; of a camera the same as `number`
  cv::Mat image;          ///< 8-bit BGR, as filmed
  Clock::time_point taken;  ///< when it came
};

/// Images of one camera, one after the other. Used on one thread at a time.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// The next image; waits until there is one. Nothing at the end, and soon after a stop was asked for
  /// (`stop_requested`). @throws FileError for an image that cannot be decoded
  virtual std::optional<SourceImage> next() = 0;
  /// Whether images come in their own time, so that one that is not taken at once is gone.
  virtual bool live() const = 0;
  virtual cv::Size size() const = 0;
  virtual double frames_per_second() const = 0;
  /// What it is, for messages.
  virtual const std::string& name() const = 0;
};

struct SourceOptions {
  bool live = false;                ///< a file comes at its own rate, as from a camera
  int repeat = 1;                   ///< how often a file is played
  double frames_per_second = 25.0;  ///< of a folder of images, and of whatever does not say
};

/// Whether a source is the number of a camera.
bool is_camera(const std::string& source);
/// @param source the number of a camera (0: the first), a video file, or a folder of images, which come in the order
///   of their names
/// @throws UsageError when it is none of these, or a camera cannot be opened
std::unique_ptr<FrameSource> open_source(const std::string& source, const SourceOptions& options = {});

}  // namespace doppel
