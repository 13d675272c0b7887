#include "doppel/view/view_sequence.h"

#include "doppel/core/log.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/track/points/track_points.h"

namespace doppel {
namespace {

PointMotion points_if_any(const Capture& capture, const SequenceEntry& sequence, const CaptureCameras& filmed) {
  if (sequence.keypoints.empty()) return {};
  if (filmed.cameras.size() < 2) {
    log::warn("the points are not shown: points in space need at least two cameras");
    return {};
  }
  log::info("finding the person's points in the {} cameras of sequence {}", filmed.cameras.size(), sequence.name);
  try {
    return points_of_sequence(capture, sequence, filmed);
  } catch (const std::exception& e) {
    log::warn("the points are not shown: {}", e.what());
    return {};
  }
}

}  // namespace

ViewSequence open_view_sequence(const Capture& capture, const SequenceEntry& sequence, const ViewCameras& cameras) {
  SequenceEntry videos = sequence;  // the rows are those of the videos, also where masks are fewer
  videos.masks = {};
  const CaptureCameras filmed = cameras.filmed();
  const RowRange rows = rows_of_sequence(capture, videos, filmed);
  videos.last_frame = rows.last;
  return {capture.name + ", " + sequence.name, rows.first, rows.last - rows.first + 1,
          points_if_any(capture, videos, filmed)};
}

}  // namespace doppel
