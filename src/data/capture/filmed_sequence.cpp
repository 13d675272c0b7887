#include "doppel/data/capture/filmed_sequence.h"

#include <algorithm>
#include <limits>

#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/mask_source.h"
#include "doppel/data/capture/video.h"

namespace doppel {

bool has_images(const Capture& capture, const SequenceEntry& sequence, const Camera& camera, int file_index) {
  const std::string path = capture.source(sequence.videos, file_index, camera.name);
  return has_frame_placeholder(path) || std::filesystem::exists(path);
}

CaptureCameras filmed_cameras(const Capture& capture) {
  CaptureCameras filmed = choose_cameras(capture);
  const SequenceEntry& sequence = capture.sequences.front();
  for (std::size_t c = 0; c < filmed.cameras.size(); ++c) {
    Camera& camera = filmed.cameras[c];
    const std::string source = capture.source(sequence.videos, filmed.file_index[c], camera.name);
    if (has_images(capture, sequence, camera, filmed.file_index[c]))
      camera = fit_to_images(camera, open_frames(source, PixelFormat::colour)->size(), source);
    else
      log::info(
          "camera {}: there is no video {}; its calibration is assumed to be at the resolution of the keypoints' "
          "images",
          camera.name, source);
  }
  return filmed;
}

RowRange rows_of_sequence(const Capture& capture, const SequenceEntry& sequence, const CaptureCameras& filmed) {
  long rows = std::numeric_limits<long>::max();
  long expected = sequence.last_frame.value_or(-1) + 1;
  for (std::size_t c = 0; c < filmed.cameras.size(); ++c) {
    const Camera& camera = filmed.cameras[c];
    const int index = filmed.file_index[c];
    if (sequence.masks.empty() && sequence.last_frame && !has_images(capture, sequence, camera, index)) {
      rows = std::min(rows, *sequence.last_frame + 1);  // keypoints alone
      continue;
    }
    const auto frames = !sequence.masks.empty()
                            ? open_masks(capture, sequence, camera.name, index, PixelFormat::grey)
                            : open_frames(capture.source(sequence.videos, index, camera.name), PixelFormat::colour);
    const long found = frames->num_frames(expected);
    const long filmed_rows = capture.clock(sequence, camera.name).num_rows(found);
    if (filmed_rows <= 0)
      fail(
          "sequence {}: camera {} filmed no frame of it, with the {} frames of {}; the file is damaged, or the "
          "frame_offset in capture.yaml belongs to another file",
          sequence.name, camera.name, found, frames->source());
    rows = std::min(rows, filmed_rows);
    if (!sequence.last_frame) expected = found;
  }
  const RowRange range{sequence.first_frame, sequence.last_frame.value_or(rows - 1)};
  if (range.last >= rows || range.first > range.last)
    fail("sequence {}: frames {} to {} are requested, but all cameras together have frames 0 to {}", sequence.name,
         range.first, range.last, rows - 1);
  return range;
}

}  // namespace doppel
