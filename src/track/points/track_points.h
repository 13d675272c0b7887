#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/track/points/point_motion.h"
#include "doppel/track/track_task.h"

namespace doppel {

struct TrackPointsOptions : TrackTask {
  PointMotionOptions motion;
};

/// A sequence of the report.
struct TrackedPoints {
  std::string sequence;
  PointMotion motion;
};
struct TrackPointsReport {
  std::vector<TrackedPoints> sequences;
};
/// The content of `track.json`.
nlohmann::ordered_json to_json(const TrackPointsReport& report);

/// One person's points in space in a sequence with keypoints, short gaps filled, smoothed.
/// @param filmed filmed_cameras(capture), or some of these cameras, at least two
/// @param options `motion` and `limit_frames`
/// @throws Error when the sequence has no keypoints, or no point that two cameras agree on; FileError as the readers
PointMotion points_of_sequence(const Capture& capture, SequenceEntry entry, const CaptureCameras& filmed,
                               const TrackPointsOptions& options = {});

/// Finds one person's points in space in a capture with keypoints of at least two cameras. No character is needed.
/// Writes into `options.out`:
/// - `points.npy` float32 [F, K, 3], world metres; of several sequences `<sequence>_points.npy`
/// - `<sequence>.trc`: the same with names
/// - `track.json`: the report that is returned
/// @param path of a capture, not prepared
/// @throws Error when a sequence has no keypoints, one camera, or no point that two cameras agree on; UsageError for an
/// unknown sequence; FileError as the readers
TrackPointsReport track_points(const std::filesystem::path& path, const TrackPointsOptions& options);

/// Joins the results of shards in `options.out`. @param shards folders of all shards, by their index
void merge_points(const std::filesystem::path& path, const TrackPointsOptions& options,
                  const std::vector<std::filesystem::path>& shards);

}  // namespace doppel
