#include "doppel/data/capture/mask_source.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"
#include "doppel/detect/masks/components.h"
#include "doppel/detect/masks/mask.h"
#include "doppel/geometry/image_file.h"

namespace doppel {

namespace {

constexpr long kMaxEmptyFrames = 200;  ///< more frames do not improve the model of one scene

/// @param source of the empty scene, for one camera
BackgroundModel learn_scene(const BackgroundSubtraction& subtraction, const std::string& source) {
  BackgroundModel model(subtraction.model);
  if (!has_frame_placeholder(source) && cv::haveImageReader(source)) {
    model.learn(read_colour_image(source));
    return model;
  }
  const auto frames = open_frames(source, PixelFormat::colour);
  const long first = subtraction.first_frame;
  const long last = subtraction.last_frame ? *subtraction.last_frame : frames->num_frames(-1) - 1;
  if (last < first) fail_at({source, 0}, "contains no frame of the empty scene");
  const long count = std::min(last - first + 1, kMaxEmptyFrames);
  for (long i = 0; i < count; ++i) model.learn(frames->read(first + i * (last - first + 1) / count));
  return model;
}

/// Frames of files that are numbered in another way.
class RenumberedReader : public FrameReader {
 public:
  /// @param offset the number of frame 0 in `files`
  RenumberedReader(std::unique_ptr<FrameReader> files, long offset) : files_(std::move(files)), offset_(offset) {}

  cv::Mat read(long frame) override { return files_->read(frame + offset_); }
  cv::Size size() override { return files_->size(); }
  long num_frames(long expected) override {
    return std::max(0L, files_->num_frames(expected < 0 ? expected : expected + offset_) - offset_);
  }
  const std::string& source() const override { return files_->source(); }
  std::vector<cv::Mat> samples(int most) override { return files_->samples(most); }

 private:
  std::unique_ptr<FrameReader> files_;
  long offset_;
};

}  // namespace

std::unique_ptr<FrameReader> open_masks(const Capture& capture, const SequenceEntry& sequence,
                                        const std::string& camera, int file_index, PixelFormat format) {
  std::unique_ptr<FrameReader> files = open_frames(capture.source(sequence.masks, file_index, camera), format);
  const long offset = sequence.mask_offset_of(camera);
  return offset == 0 ? std::move(files) : std::make_unique<RenumberedReader>(std::move(files), offset);
}

MaskSource::MaskSource(const Capture& capture, const SequenceEntry& sequence, const Camera& camera, int file_index)
    : sequence_(sequence), undistort_(camera) {
  const auto source = [&](const CameraPaths& paths) { return capture.source(paths, file_index, camera.name); };
  if (const auto& subtraction = sequence.subtraction)
    model_ = learn_scene(*subtraction, source(subtraction->empty.empty() ? sequence.videos : subtraction->empty));
  else if (!sequence.chroma_key)
    masks_ = open_masks(capture, sequence, camera.name, file_index);
  else if (sequence.chroma_key->against_background)
    background_ = read_colour_image(source(capture.background));
}

MaskSource::MaskSource(BackgroundModel model, const SequenceEntry& sequence, const Camera& camera)
    : sequence_(sequence), undistort_(camera), model_(std::move(model)) {}

cv::Mat MaskSource::find(long frame, const cv::Mat& image) {
  if (masks_) return masks_->read(frame);
  return model_ ? model_->mask(image) : chroma_key_mask(image, *sequence_.chroma_key, background_);
}

MaskSource::MaskSource(const SequenceEntry& sequence, const Camera& camera) : sequence_(sequence), undistort_(camera) {}

cv::Mat MaskSource::read(long frame, const cv::Mat& image) { return cut(find(frame, image)); }

cv::Mat MaskSource::cut(cv::Mat grey) const {
  const cv::Size size(undistort_.pinhole().width, undistort_.pinhole().height);
  if (grey.size() != size) {
    cv::Mat resized;
    cv::resize(grey, resized, size, 0.0, 0.0, cv::INTER_LINEAR);
    grey = resized;
  }
  const cv::Mat mask = threshold_mask(undistort_.apply(grey), sequence_.mask_threshold);
  return sequence_.largest_component ? largest_component(mask) : mask;
}

MaskReader::MaskReader(const Capture& capture, const SequenceEntry& sequence, const Camera& camera, int file_index)
    : masks_(capture, sequence, camera, file_index) {
  if (masks_.needs_image())
    images_ = open_frames(capture.source(sequence.videos, file_index, camera.name), PixelFormat::colour);
}

cv::Mat MaskReader::read(long frame) { return masks_.read(frame, images_ ? images_->read(frame) : cv::Mat()); }

}  // namespace doppel
