#pragma once

#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/mask_source.h"
#include "doppel/data/capture/video.h"

namespace doppel {

/// The cameras of a capture with their images of one sequence. Reading is thread-safe.
class ViewCameras {
 public:
  /// The cameras that have a video, or images, of the sequence; none when its files are missing.
  /// @throws Error as choose_cameras and fit_to_images
  ViewCameras(const Capture& capture, const SequenceEntry& sequence);
  ViewCameras(const ViewCameras&) = delete;
  ViewCameras& operator=(const ViewCameras&) = delete;
  ~ViewCameras();

  std::size_t size() const { return views_.size(); }
  /// The cameras at the resolution of their images, with their lenses.
  CaptureCameras filmed() const;
  bool has_masks() const { return sequence_.has_masks(); }
  /// JSON: `masks` (whether there are any) and `cameras`, each with `name`, `width`, `height`, `K` [3][3] (pixels),
  /// `R` [3][3] and `t` [3] (camera from world, metres), without lens distortion.
  std::string description() const;
  /// A JPEG of what the camera filmed at a row of the sequence's motion, without lens distortion, its longer side at
  /// most 1280 pixels. A video is decoded forwards; an earlier frame than before starts again.
  /// @param mask the person's mask is painted green
  /// @throws UsageError for a camera or mask that does not exist; FileError when the frame cannot be read
  std::string image(int camera, long row, bool mask);

 private:
  struct View;
  cv::Mat read(View& view, long frame, bool mask);

  Capture capture_;
  SequenceEntry sequence_;
  std::vector<std::unique_ptr<View>> views_;
  std::mutex readers_;  ///< one request at a time decodes
};

}  // namespace doppel
