#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "doppel/data/background_model.h"
#include "doppel/data/capture.h"
#include "doppel/data/mask.h"
#include "doppel/data/video.h"

namespace doppel {

/// The masks of one camera in one sequence: from its mask files, or cut out of its pictures by colour or by subtraction
/// of the empty scene, as the capture says: thresholded, 0 or 255, of the picture's size and without lens distortion.
class MaskSource {
 public:
  /// Opens the mask files or the picture of the empty studio, or learns the empty scene.
  /// @param camera with its distortion, at the resolution of the pictures
  /// @param file_index its place in the calibration file
  /// @throws FileError when one of them cannot be read
  MaskSource(const Capture& capture, const SequenceEntry& sequence, const Camera& camera, int file_index);
  /// Cuts them out of pictures by a model that has learnt the empty scene, whatever the sequence says.
  MaskSource(BackgroundModel model, const SequenceEntry& sequence, const Camera& camera);

  /// Whether `read` needs the picture.
  bool needs_picture() const { return !masks_; }
  /// @param frame of the video, in ascending order @param picture of this frame, BGR, as filmed; unused unless needed
  cv::Mat read(long frame, const cv::Mat& picture);

 private:
  cv::Mat find(long frame, const cv::Mat& picture);

  SequenceEntry sequence_;
  Undistorter undistort_;
  std::unique_ptr<FrameReader> masks_;
  cv::Mat background_;
  std::optional<BackgroundModel> model_;
};

}  // namespace doppel
