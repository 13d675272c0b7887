#pragma once

/// What finds pose and surface in what a live picture shows.

#include <memory>

#include "doppel/track/deepcap.h"
#include "doppel/track/live/live_view.h"
#include "doppel/track/livecap/livecap_config.h"

namespace doppel {

class LiveSolver {
 public:
  virtual ~LiveSolver() = default;
  virtual LivecapFrame solve(const FootageFrame& seen) = 0;
  /// Time went by that nobody saw: the next frame does not follow from those before, but the person is the same.
  virtual void pause() = 0;
};

/// The one-camera tracker (chapter 4). @param view must outlive it
std::unique_ptr<LiveSolver> make_livecap_solver(const LiveView& view, const LivecapConfig& config);
/// Trained networks (chapter 5), frame by frame. @param trained and @param view must outlive it
/// @throws Error as `DeepcapTracker`, or when the run is of another character
std::unique_ptr<LiveSolver> make_deepcap_solver(const LiveView& view, TrainedPose& trained);
/// PoseNet as a finder of joints in space (4.4). @param trained and @param view must outlive it
/// @throws as `make_deepcap_solver`
JointFinder joints_of_posenet(const LiveView& view, TrainedPose& trained);

}  // namespace doppel
