#pragma once

#include <memory>

#include "doppel/track/deepcap/deepcap_tracker.h"
#include "doppel/track/fit/track_config.h"
#include "doppel/track/frame_tracker.h"
#include "doppel/track/livecap/livecap_config.h"

namespace doppel {

/// The multi-view fit. @param character with the template to fit; it and `footage` must outlive the tracker
/// @throws as MultiviewTracker
std::unique_ptr<FrameTracker> make_multiview_tracker(const Footage& footage, const Character& character,
                                                     const TrackConfig& config);

/// The one-camera tracker of chapter 4. @param character must outlive the tracker
/// @throws as LivecapTracker
std::unique_ptr<FrameTracker> make_livecap_tracker(const Character& character, const std::vector<Marker>& landmarks,
                                                   const PinholeCamera& camera, const LivecapConfig& config);

/// What the DeepCap tracker returns for a lost frame.
enum class LostFrames {
  report,  ///< a lost frame; the caller bridges it when all frames are known
  hold     ///< the last tracked pose with its surface, for live images
};
/// DeepCap, the trained networks of chapter 5. With `hold` every result has vertices.
/// @param trained must outlive the tracker
/// @throws Error as DeepcapTracker, or when the run was trained for another character
std::unique_ptr<FrameTracker> make_deepcap_tracker(TrainedPose& trained, const Character& character,
                                                   const std::vector<Marker>& landmarks, const PinholeCamera& camera,
                                                   LostFrames lost);

}  // namespace doppel
