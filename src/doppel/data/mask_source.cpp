#include "doppel/data/mask_source.h"

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"

namespace doppel {

namespace {

cv::Mat read_background(const std::string& path) {
  cv::Mat image;
  if (std::filesystem::is_regular_file(path)) image = cv::imread(path, cv::IMREAD_COLOR);
  if (image.empty()) fail_at({path, 0}, "the picture of the empty studio is missing or cannot be decoded");
  return image;
}

}  // namespace

MaskSource::MaskSource(const SequenceEntry& sequence, const Camera& camera, const std::string& masks,
                       const std::string& background)
    : sequence_(sequence), undistort_(camera) {
  if (!sequence.chroma_key)
    masks_ = open_frames(masks, PixelFormat::grey);
  else if (sequence.chroma_key->against_background)
    background_ = read_background(background);
}

cv::Mat MaskSource::read(long frame, const cv::Mat& picture) {
  cv::Mat grey = masks_ ? masks_->read(frame) : chroma_key_mask(picture, *sequence_.chroma_key, background_);
  const cv::Size size(undistort_.pinhole().width, undistort_.pinhole().height);
  if (grey.size() != size) {
    cv::Mat resized;
    cv::resize(grey, resized, size, 0.0, 0.0, cv::INTER_LINEAR);
    grey = resized;
  }
  const cv::Mat mask = threshold_mask(undistort_.apply(grey), sequence_.mask_threshold);
  return sequence_.largest_component ? largest_component(mask) : mask;
}

}  // namespace doppel
