#pragma once

/// What tracking finds of a sequence, and what every method writes of it.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/track/footage.h"
#include "doppel/track/multiview.h"
#include "doppel/track/track_surface.h"

namespace doppel {

/// A tracked sequence.
struct TrackedSequence {
  FootageSequence sequence;
  std::vector<TrackedFrame> frames;  ///< as they were fitted
  Motion motion;                     ///< [last_frame + 1] bridged and smoothed; rows before the first frame repeat it
  double seconds = 0.0;              ///< of fitting, without reading
  std::optional<TrackedSurface> surface;

  int count(FrameState state) const;
};

/// How far tracked landmarks are from those of another motion of the same frames.
struct MotionDifference {
  double mean_mm = 0.0;       ///< over landmarks and frames
  double within_150mm = 0.0;  ///< share, relative to the mean of all landmarks
};
MotionDifference compare_motions(const Skeleton& skeleton, const std::vector<Marker>& landmarks, const Motion& a,
                                 const Motion& b, long first_frame, long last_frame);

/// Places of the sequences of these names; all without names. @throws UsageError for one that is not there
std::vector<int> chosen_sequences(const Footage& footage, const std::vector<std::string>& names);
/// So many frames, spread over a sequence.
std::vector<long> spread_frames(const FootageSequence& sequence, int count);

/// Fills in `motion` from the poses of all frames: those not to be trusted are bridged, all are smoothed.
/// @param smoothing as for `smooth_poses` @throws Error when no frame is to be trusted
void make_motion(TrackedSequence& tracked, const std::optional<RootRotation>& root, double smoothing);

/// @throws UsageError when the folder holds the capture itself, or none is given
void check_out_folder(const Footage& footage, const std::filesystem::path& out);
/// `<sequence>.motion` and `<sequence>.bvh` in the folder `out`.
void write_poses(const Footage& footage, const std::filesystem::path& out, const TrackedSequence& tracked);
/// `capture.yaml` in `out`: the capture with the tracked motions in the place of its own.
void write_tracked_capture(const Footage& footage, const std::filesystem::path& out,
                           const std::vector<TrackedSequence>& tracked);
/// States, errors and speed of a sequence, the difference from the motion that the capture names, and per frame state,
/// costs and steps.
nlohmann::ordered_json report_of(const Footage& footage, const TrackedSequence& tracked);

}  // namespace doppel
