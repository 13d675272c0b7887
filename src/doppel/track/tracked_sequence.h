#pragma once

/// What tracking finds of a sequence, and what every method writes of it.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/track/footage.h"
#include "doppel/track/track_surface.h"
#include "doppel/track/tracked_frame.h"

namespace doppel {

/// A tracked sequence.
struct TrackedSequence {
  FootageSequence sequence;
  std::vector<TrackedFrame> frames;  ///< as they were fitted
  Motion motion;                     ///< [last_frame + 1] bridged and smoothed; rows before the first frame repeat it
  double seconds = 0.0;              ///< of fitting, without reading
  std::optional<TrackedSurface> surface;
  std::filesystem::path vertices;  ///< the file of its surfaces, float32 [frames,N,3]; empty: none was written

  int count(FrameState state) const;
};

/// How far tracked landmarks are from those of another motion of the same frames.
struct MotionDifference {
  double mean_mm = 0.0;       ///< over landmarks and frames
  double aligned_mm = 0.0;    ///< the same after the similarity transform of each frame that fits best
  double within_150mm = 0.0;  ///< share, relative to the mean of all landmarks
  std::vector<double> frame_mm, frame_aligned_mm;  ///< [frames] means over landmarks
};
MotionDifference compare_motions(const Skeleton& skeleton, const std::vector<Marker>& landmarks, const Motion& a,
                                 const Motion& b, long first_frame, long last_frame);

/// Fills in `motion` from the poses of all frames: those not to be trusted are bridged, all are smoothed.
/// @param smoothing, degree as for `smooth_poses` @throws Error when no frame is to be trusted
void make_motion(TrackedSequence& tracked, const std::optional<RootRotation>& root, double smoothing, int degree = 0);

/// `<sequence>.motion` and `<sequence>.bvh` in the folder `out`.
void write_poses(const Character& character, double frames_per_second, const std::filesystem::path& out,
                 const TrackedSequence& tracked);
/// States, errors and speed of a sequence.
nlohmann::ordered_json summary_of(const TrackedSequence& tracked);
/// The summary, the difference from the motion that the capture names and from the true surfaces where it has them
/// (`truth.h`), and per frame state, costs, steps and these differences.
nlohmann::ordered_json report_of(const Footage& footage, const TrackedSequence& tracked);
/// What each term of an energy costs.
nlohmann::ordered_json costs_json(const std::vector<TermCost>& terms);
/// `capture.yaml` in `out`, the capture with the tracked motions in the place of its own; `track.json`, the report; and
/// `track.html`, its curves over time.
void write_results(const Footage& footage, const std::filesystem::path& out,
                   const std::vector<TrackedSequence>& tracked, const nlohmann::ordered_json& report);

}  // namespace doppel
