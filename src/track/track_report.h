#pragma once

/// The report of tracking. `to_json` gives the content of `track.json`.

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/eval/pose_metrics.h"
#include "doppel/track/surface_errors.h"
#include "doppel/track/tracked_sequence.h"

namespace doppel {

/// Distances of tracked landmarks from those of another motion of the same frames.
struct MotionDifference {
  double landmarks_mm = 0.0;                       ///< mean over landmarks and frames
  double aligned_landmarks_mm = 0.0;               ///< the same after the best similarity transform of each frame
  std::vector<double> frame_mm, frame_aligned_mm;  ///< [frames] means over landmarks
  /// Of the 14 common joints, as `doppel evaluate` computes them; nothing if a landmark is missing.
  std::optional<PoseScores> poses;
};
MotionDifference compare_motions(const Skeleton& skeleton, const std::vector<Marker>& landmarks, const Motion& a,
                                 const Motion& b, long first_frame, long last_frame);

/// Overlap of LiveCap's surface with the mask, in the frames that were found and have a mask.
struct LivecapOverlap {
  std::size_t frame = 0;             ///< counted from the first
  double pose = 0.0, surface = 0.0;  ///< IoU of the skinned and of the deformed template
};

/// Measurements of a live run.
struct LiveFigures {
  std::string source;
  long images = 0, dropped = 0;
  long behind = 0;  ///< largest number of images that arrived while a frame was processed
  double frames_per_second = 0.0;
  double latency_ms = 0.0, largest_latency_ms = 0.0;
  double capture_ms = 0.0, preprocess_ms = 0.0, detect_ms = 0.0, pose_ms = 0.0, surface_ms = 0.0;  ///< of a frame
  double settled_megabytes = 0.0, final_megabytes = 0.0;  ///< main memory after 100 frames, and at the end
  std::vector<std::pair<long, std::string>> changes;      ///< image, and the state from this image on
};

struct SequenceReport {
  TrackedSequence tracked;
  std::optional<MotionDifference> difference;  ///< from the motion that the capture names
  std::optional<SurfaceErrors> errors;         ///< where the capture has ground truth surfaces
  std::optional<std::vector<LivecapOverlap>> livecap;
  std::optional<LiveFigures> live;  ///< of a live run, which reports no single frames

  std::vector<long> lost_frames() const;
  double keypoint_error() const;     ///< mean over frames, reference pixels
  double steps_per_frame() const;    ///< Gauss-Newton steps
  double frames_per_second() const;  ///< of fitting; 0 where no time was measured
};
/// Compares a sequence with the motion and the ground truth surfaces of the capture, where it has them.
SequenceReport report_of(const Footage& footage, TrackedSequence tracked);

/// Means over the frames of a surface that the multi-view fit deformed.
struct SurfaceSummary {
  double posed_overlap = 0.0, overlap = 0.0;  ///< IoU with the masks, skinned and deformed
  double steps_per_frame = 0.0, frames_per_second = 0.0;
};
SurfaceSummary summarise(const TrackedSurface& surface);

/// Means over the frames of LiveCap.
struct LivecapSummary {
  double posed_overlap = 0.0, overlap = 0.0;  ///< IoU with the masks, skinned and deformed
  double frames_per_second = 0.0;             ///< including reading
  double read_ms = 0.0, pose_ms = 0.0, surface_ms = 0.0, frame_ms = 0.0;
};
/// @pre report.livecap
LivecapSummary summarise_livecap(const SequenceReport& report);

struct TrackReport {
  std::string method;
  std::filesystem::path character;  ///< `.character` file that the run wrote; empty: the motions are of the capture's
  std::map<std::string, std::int64_t> steps;                ///< of trained stages; empty without networks
  std::vector<std::pair<std::string, double>> shared_dofs;  ///< names and values of the DoFs fitted for all frames
  std::vector<std::pair<std::string, double>> bone_scales;  ///< factors of the character's bones; empty: not fitted
  std::vector<SequenceReport> sequences;
};
/// Whether a sequence ends before its footage does. It is the last of the report.
bool is_stopped(const TrackReport& report);
nlohmann::ordered_json to_json(const TrackReport& report);

}  // namespace doppel
