#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/video.h"
#include "doppel/detect/masks/background_model.h"
#include "doppel/geometry/undistorter.h"

namespace doppel {

/// The mask files of one camera, whose frames are those of its video (`SequenceEntry::mask_offset`).
/// @param file_index index of the camera in the calibration file @throws FileError as open_frames
std::unique_ptr<FrameReader> open_masks(const Capture& capture, const SequenceEntry& sequence,
                                        const std::string& camera, int file_index,
                                        PixelFormat format = PixelFormat::mask);

/// The masks of one camera in one sequence. As configured in the capture, they come from mask files, from chroma keying
/// or from background subtraction. Masks are thresholded (0 or 255), of the image's size and without lens distortion.
class MaskSource {
 public:
  /// Opens the mask files or the image of the empty studio, or learns the empty scene. @pre sequence.has_masks()
  /// @param camera with its distortion, at the resolution of the images
  /// @param file_index index of the camera in the calibration file
  /// @throws FileError when one of them cannot be read
  MaskSource(const Capture& capture, const SequenceEntry& sequence, const Camera& camera, int file_index);
  /// Computes masks by a model that has learnt the empty scene, whatever the sequence configures.
  MaskSource(BackgroundModel model, const SequenceEntry& sequence, const Camera& camera);
  /// Finds no masks itself: only `cut` may be called.
  MaskSource(const SequenceEntry& sequence, const Camera& camera);

  /// Whether `read` needs the image.
  bool needs_image() const { return !masks_; }
  /// @param frame of the video, in ascending order
  /// @param image of this frame, BGR, as filmed; used only if `needs_image`
  cv::Mat read(long frame, const cv::Mat& image);
  /// The mask of an image whose pixels are the person by a probability (times 255, 8-bit, as filmed).
  cv::Mat cut(cv::Mat grey) const;

 private:
  cv::Mat find(long frame, const cv::Mat& image);

  SequenceEntry sequence_;
  Undistorter undistort_;
  std::unique_ptr<FrameReader> masks_;
  cv::Mat background_;
  std::optional<BackgroundModel> model_;
};

/// The masks of one camera by frame, for who needs no images: these are opened only where masks are computed from them.
class MaskReader {
 public:
  /// @throws FileError as MaskSource and open_frames @pre sequence.has_masks()
  MaskReader(const Capture& capture, const SequenceEntry& sequence, const Camera& camera, int file_index);

  /// @param frame of the video, in ascending order @return as MaskSource::read
  cv::Mat read(long frame);

 private:
  MaskSource masks_;
  std::unique_ptr<FrameReader> images_;
};

}  // namespace doppel
