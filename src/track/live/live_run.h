#pragma once

/// Tracking what comes as it comes (4.7.3).

#include <string>

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
  double silence = 1.0;    ///< seconds without an image after which the person counts as lost
};

/// What is said of a frame while it happens.
enum class LiveState { tracking, lost, recovered };
const char* to_string(LiveState state);

/// Four stages, each on a thread of its own: images are taken; masks are cut out; points are found; pose and surface
/// are solved. What comes out is shown on the calling thread. Between two stages waits one frame at most, so that a
/// result is two frames behind the image that is being looked at. Where the source is live an image that is not
/// taken in time is replaced by the next, and counted; where it is not, none is dropped and the results do not depend
/// on the number of threads.
///
/// Ends with the source, after `limit_frames` images, when a stop is asked for (`stop_requested`) or when whoever
/// watches the preview ends it; what was under way is finished and written.
///
/// Writes into `options.out` `live.motion` and `live.bvh` (a row a tracked image), `live_vertices.npy` where asked
/// for, and `track.json`: what is returned: states and when they changed, rate, latency, what was dropped, milliseconds
/// of every stage.
/// @param view sees what `source` takes @param preview may be null
/// @throws Error when no image came, and whatever a stage throws
TrackReport track_live(FrameSource& source, LiveView& view, FrameTracker& tracker, const LiveRunOptions& options,
                       Preview* preview = nullptr);

}  // namespace doppel
