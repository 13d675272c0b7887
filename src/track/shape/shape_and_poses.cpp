#include "doppel/track/shape/shape_and_poses.h"

#include <fmt/format.h>

#include <algorithm>

#include "doppel/character/landmarks.h"
#include "doppel/core/error.h"
#include "doppel/core/statistics.h"
#include "doppel/track/track_task.h"

namespace doppel {
namespace {

std::vector<SpaceLandmarks> landmarks_in_space(const std::vector<PinholeCamera>& cameras, const SeenFrames& frames,
                                               int num_landmarks) {
  std::vector<SpaceLandmarks> found;
  for (const FrameEvidence& seen : frames.seen) {
    SpaceLandmarks landmarks;
    for (const auto& point : triangulate_all(cameras, seen, num_landmarks))
      landmarks.push_back(point ? std::optional(point->position) : std::nullopt);
    found.push_back(std::move(landmarks));
  }
  return found;
}

}  // namespace

SeenFrames see_frames(const Footage& footage, const std::vector<FootageSequence>& sequences, int count,
                      Progress& progress) {
  const long all = count_frames(sequences);
  SeenFrames result;
  for (const FootageSequence& sequence : sequences) {
    const auto reader = footage.read(sequence.index);
    const int share = std::max(1, static_cast<int>(count * sequence.num_frames() / std::max(1L, all)));
    for (const long frame : spread_frames(sequence, share)) {
      check_not_stopped(sequence, frame);
      result.samples.push_back({sequence.index, frame});
      result.seen.push_back(reader->read(frame, false).evidence);
      progress.advance(1, "reading");
    }
  }
  return result;
}

double triangulation_residual(const std::vector<PinholeCamera>& cameras, const SeenFrames& frames, int num_landmarks) {
  std::vector<double> residuals;
  for (const FrameEvidence& seen : frames.seen)
    for (const auto& point : triangulate_all(cameras, seen, num_landmarks))
      if (point) residuals.insert(residuals.end(), point->residuals.begin(), point->residuals.end());
  return median(std::move(residuals));
}

PosedFrames find_poses(const Character& character, const std::vector<Marker>& landmarks,
                       const std::vector<PinholeCamera>& cameras, const SeenFrames& frames, const TrackConfig& config) {
  MultiviewTracker tracker(character, landmarks, chosen_dofs(config.dofs, character.skeleton, landmarks), cameras,
                           config.fit);
  const OutlineFinder outlines(character, cameras, config.fit.outline_vertices);
  PosedFrames result;
  for (std::size_t f = 0; f < frames.seen.size(); ++f) {
    tracker.cut();
    TrackedFrame found = tracker.track(frames.seen[f]);
    if (!found.found()) continue;
    result.keypoint_error += found.keypoint_error;
    result.inlier_ratio += found.inlier_ratio;
    result.overlap +=
        outlines.overlap(frames.seen[f], posed_vertices(tracker.model(), tracker.model().pose(found.dofs, false)));
    result.frames.push_back({frames.seen[f], std::move(found.dofs)});
    result.samples.push_back(frames.samples[f]);
  }
  if (result.frames.empty())
    fail(
        "in none of {} frames a pose of {} fits the keypoints; do the keypoints of the cameras agree? `doppel doctor` "
        "tells",
        frames.seen.size(), character.name);
  const auto count = static_cast<double>(result.frames.size());
  result.keypoint_error /= count;
  result.inlier_ratio /= count;
  result.overlap /= count;
  return result;
}

ShapedCharacter find_shape(const ShapeFamily& family, const std::vector<std::string>& landmarks,
                           const std::vector<PinholeCamera>& cameras, const SeenFrames& frames,
                           const TrackConfig& config, const ShapeRounds& rounds, Progress& progress) {
  const int count = static_cast<int>(landmarks.size());
  ShapeFitOptions fit = rounds.fit;
  fit.images = config.fit;
  ShapedCharacter result;
  result.parameters = shape_from_landmarks(family, landmarks, landmarks_in_space(cameras, frames, count));
  for (int round = 0;; ++round) {
    result.character = family.character(result.parameters);
    result.poses =
        find_poses(result.character, markers_named(result.character.skeleton, landmarks), cameras, frames, config);
    progress.advance(1,
                     fmt::format("keypoints {:.1f} px, IoU {:.3f}", result.poses.keypoint_error, result.poses.overlap));
    if (round == rounds.rounds) return result;
    result.parameters = fit_shape(family, landmarks, cameras, result.poses.frames, result.parameters, fit);
  }
}

ShapedCharacter find_shape(const ShapeFamily& family, const Footage& footage,
                           const std::vector<FootageSequence>& sequences, const TrackConfig& config, int count,
                           const std::string& title) {
  const ShapeRounds rounds;
  Progress progress(title, count + rounds.rounds + 1);
  const SeenFrames seen = see_frames(footage, sequences, count, progress);
  ShapedCharacter shaped =
      find_shape(family, landmark_names(footage.landmarks()), footage.cameras(), seen, config, rounds, progress);
  progress.finish();
  return shaped;
}

}  // namespace doppel
