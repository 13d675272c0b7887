#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "doppel/data/capture.h"
#include "doppel/data/mask.h"
#include "doppel/data/video.h"

namespace doppel {

/// The masks of one camera in one sequence, from its mask files or cut out of its pictures by colour, as the capture
/// says: thresholded, 0 or 255, of the picture's size and without lens distortion.
class MaskSource {
 public:
  /// @param camera with its distortion, at the resolution of the pictures
  /// @param masks path or pattern of this camera's masks, unused with a chroma key
  /// @param background this camera's picture of the empty studio, used by keys that compare with it
  /// @throws FileError when one of them cannot be read
  MaskSource(const SequenceEntry& sequence, const Camera& camera, const std::string& masks,
             const std::string& background);

  /// Whether `read` needs the picture.
  bool needs_picture() const { return !masks_; }
  /// @param frame of the video, in ascending order @param picture of this frame, BGR, as filmed; unused unless needed
  cv::Mat read(long frame, const cv::Mat& picture);

 private:
  SequenceEntry sequence_;
  Undistorter undistort_;
  std::unique_ptr<FrameReader> masks_;
  cv::Mat background_;
};

}  // namespace doppel
