#pragma once

/// Tracking of live images (4.7.3).

#include <functional>
#include <string>
#include <vector>

#include "doppel/track/frame_tracker.h"
#include "doppel/track/live/frame_source.h"
#include "doppel/track/live/live_view.h"
#include "doppel/track/preview.h"
#include "doppel/track/track_report.h"
#include "doppel/track/track_task.h"

namespace doppel {

struct LiveRunOptions : TrackTask {
  std::string method = "livecap";
  bool filter = false;     ///< average the written vertices with those of the frames before and after (4.8)
  double smoothing = 0.0;  ///< sigma of the Gaussian over the written poses, frames; 0: none
  /// Called with each result on the thread of the fit: the DoFs, the seconds since the first result, and whether the
  /// person is tracked. May be empty.
  std::function<void(const std::vector<double>&, double, bool)> on_pose;
  double silence = 1.0;  ///< seconds without an image after which the state is `lost`
};

/// The state of a live run.
enum class LiveState { tracking, lost, recovered };
const char* to_string(LiveState state);

/// Tracks live images in four stages, each on its own thread: capture of images, preprocessing (masks), detection of
/// keypoints, and the fit of pose and surface. The calling thread shows the results. At most one frame waits between
/// two stages, which bounds how far a result is behind the newest image. With a live source, an image that is not taken
/// in time is replaced by the next one and counted as dropped. With other sources no image is dropped, and the results
/// do not depend on the number of threads.
///
/// The run ends with the source, after `limit_frames` images, on a stop request (`stop_requested`), or when the user
/// ends the preview. Frames in progress are finished and written.
///
/// Writes into `options.out`: `live.motion` and `live.bvh` (one row per tracked image), `live_vertices.npy` with
/// `vertices`, and `track.json`, the returned report: state changes, rate, latency, dropped images, milliseconds of
/// every stage.
/// @param view of the camera of `source` @param preview may be null
/// @throws Error when the source delivers no image, and any exception of a stage
TrackReport track_live(FrameSource& source, LiveView& view, FrameTracker& tracker, const LiveRunOptions& options,
                       Preview* preview = nullptr);

}  // namespace doppel
