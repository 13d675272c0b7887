#include "doppel/track/points/track_points.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/capture/person_tracks.h"
#include "doppel/track/points/point_files.h"
#include "doppel/track/track_results.h"

namespace doppel {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

std::vector<SequenceEntry> wanted_sequences(const Capture& capture, const TrackTask& task) {
  std::vector<SequenceEntry> wanted;
  std::vector<std::string> known;
  for (const SequenceEntry& entry : capture.sequences) {
    known.push_back(entry.name);
    const auto& names = task.sequences;
    if (names.empty() || std::find(names.begin(), names.end(), entry.name) != names.end()) wanted.push_back(entry);
  }
  if (!task.sequences.empty() && wanted.size() != task.sequences.size())
    fail<UsageError>("not all of the sequences {} are in the capture; it has {}", fmt::join(task.sequences, ", "),
                     fmt::join(known, ", "));
  return wanted;
}

std::vector<long> cuts_from(const SequenceEntry& entry, long first) {
  std::vector<long> cuts;
  for (const long cut : entry.cuts)
    if (cut > first) cuts.push_back(cut - first);
  return cuts;
}

ordered_json camera_json(const PointCamera& camera) {
  const double share = camera.seen > 0 ? static_cast<double>(camera.agreeing) / static_cast<double>(camera.seen) : 0.0;
  return {{"camera", camera.name}, {"points", camera.seen}, {"agreeing", share}, {"residual_px", camera.residual_px}};
}

}  // namespace

ordered_json to_json(const TrackPointsReport& report) {
  ordered_json json{{"method", "points"}, {"sequences", ordered_json::object()}};
  for (const auto& [name, motion] : report.sequences) {
    ordered_json cameras = ordered_json::array();
    for (const PointCamera& camera : motion.cameras) cameras.push_back(camera_json(camera));
    json["sequences"][name] = {{"frames", motion.frames.size()},
                               {"first_frame", motion.first_row},
                               {"fps", motion.fps},
                               {"points", motion.points},
                               {"found", motion.found()},
                               {"filled", motion.filled},
                               {"cameras", cameras}};
  }
  return json;
}

PointMotion points_of_sequence(const Capture& capture, SequenceEntry entry, const CaptureCameras& filmed,
                               const TrackPointsOptions& options) {
  RowRange rows = rows_of_sequence(capture, entry, filmed);
  if (options.limit_frames > 0) rows.last = std::min(rows.last, rows.first + options.limit_frames - 1);
  entry.last_frame = rows.last;
  const PointTracks tracks = read_person_tracks(capture, entry, filmed);
  std::vector<FrameClock> clocks;
  for (const Camera& camera : filmed.cameras) clocks.push_back(capture.clock(entry, camera.name));
  PointMotion motion =
      triangulate_tracks(tracks, filmed.cameras, clocks, capture.fps, rows.first, rows.last, options.motion);
  if (motion.found() == 0.0)
    fail(
        "sequence {}: no two cameras agree on any point; check that calibration, keypoints and `frame_offset` belong "
        "together",
        entry.name);
  fill_and_smooth(motion, cuts_from(entry, rows.first), options.motion);
  return motion;
}

TrackPointsReport track_points(const fs::path& path, const TrackPointsOptions& options) {
  const Capture capture = find_capture(path);
  const std::vector<SequenceEntry> wanted = wanted_sequences(capture, options);
  const CaptureCameras filmed = filmed_cameras(capture);
  if (filmed.cameras.size() < 2)
    fail("{} has one camera; points in space need at least two (for one camera: `doppel track livecap`)", capture.name);
  fs::create_directories(options.out);
  TrackPointsReport report;
  for (const SequenceEntry& entry : own_units(wanted, options)) {
    report.sequences.push_back({entry.name, points_of_sequence(capture, entry, filmed, options)});
    const PointMotion& motion = report.sequences.back().motion;
    const std::string array = wanted.size() > 1 ? entry.name + "_points.npy" : "points.npy";
    write_point_array(options.out / array, motion);
    write_trc(options.out / (entry.name + ".trc"), motion);
  }
  write_atomically(options.out / "track.json", to_json(report).dump(1) + "\n");
  return report;
}

void merge_points(const fs::path& path, const TrackPointsOptions& options, const std::vector<fs::path>& shards) {
  std::vector<std::string> names;
  for (const SequenceEntry& entry : wanted_sequences(find_capture(path), options)) names.push_back(entry.name);
  merge_sequences(names, options.out, shards);
}

}  // namespace doppel
