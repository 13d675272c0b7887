#include "doppel/eval/whole_frames.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/data/capture/capture_cameras.h"

namespace doppel {

namespace {

/// The camera as calibrated, with its distortion, at the resolution of the images; and its position in the calibration
/// file.
std::pair<Camera, int> calibrated_as(const Capture& capture, const PinholeCamera& camera) {
  const CaptureCameras chosen = choose_cameras(capture);
  const auto found = std::find_if(chosen.cameras.begin(), chosen.cameras.end(),
                                  [&](const Camera& each) { return each.name == camera.name; });
  if (found == chosen.cameras.end()) fail("reading whole images: the capture has no camera '{}'", camera.name);
  const bool same = found->width == camera.width && found->height == camera.height;
  return {same ? *found : found->scaled_to(camera.width, camera.height),
          chosen.file_index[found - chosen.cameras.begin()]};
}

}  // namespace

WholeFrames::WholeFrames(const Capture& capture, const PinholeCamera& camera)
    : WholeFrames(capture, calibrated_as(capture, camera)) {}

WholeFrames::WholeFrames(const Capture& capture, const std::pair<Camera, int>& calibrated)
    : capture_(capture), file_index_(calibrated.second), undistorter_(calibrated.first) {}

void WholeFrames::open(const std::string& sequence) {
  const auto entry = std::find_if(capture_.sequences.begin(), capture_.sequences.end(),
                                  [&](const SequenceEntry& each) { return each.name == sequence; });
  if (entry == capture_.sequences.end())
    fail<UsageError>("reading whole images: {} has no sequence '{}'", capture_.name, sequence);
  const std::string& camera = undistorter_.pinhole().name;
  reader_ = open_frames(capture_.source(entry->videos, file_index_, camera), PixelFormat::colour);
  sequence_ = sequence;
  clock_ = capture_.clock(*entry, camera);
  last_ = -1;
}

cv::Mat WholeFrames::read(const std::string& sequence, long frame) {
  // A video is decoded strictly forward, so an earlier frame needs a reader at the start.
  if (!reader_ || sequence != sequence_ || clock_.frame(frame) < last_) open(sequence);
  const cv::Mat image = reader_->read(clock_.frame(frame));
  last_ = clock_.frame(frame);
  const PinholeCamera& camera = undistorter_.pinhole();
  if (image.cols != camera.width || image.rows != camera.height)
    fail(
        "{}: frame {} is {}x{} pixels, but camera {} was prepared with {}x{}; prepare the capture again with "
        "--overwrite",
        reader_->source(), last_, image.cols, image.rows, camera.name, camera.width, camera.height);
  return undistorter_.apply(image);
}

}  // namespace doppel
