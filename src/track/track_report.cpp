#include "doppel/track/track_report.h"

#include <torch/types.h>

#include <numeric>

#include "doppel/character/landmarks.h"
#include "doppel/core/as_size.h"

namespace doppel {

using nlohmann::ordered_json;

namespace {

/// [1,M,3]
torch::Tensor tensor_of(const std::vector<Eigen::Vector3d>& points) {
  torch::Tensor result = torch::empty({1, static_cast<std::int64_t>(points.size()), 3}, torch::kFloat64);
  for (std::size_t i = 0; i < points.size(); ++i)
    Eigen::Map<Eigen::Vector3d>(result.data_ptr<double>() + 3 * i) = points[i];
  return result;
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// @return nothing where the capture has no motion of these frames
std::optional<MotionDifference> difference_from_given(const Footage& footage, const TrackedSequence& tracked) {
  const FootageSequence& sequence = tracked.sequence;
  if (sequence.motion.empty()) return std::nullopt;
  const Skeleton& skeleton = footage.character().skeleton;
  const Motion given = read_motion(sequence.motion, skeleton.num_dofs());
  if (given.num_frames() <= sequence.last_frame) return std::nullopt;
  return compare_motions(skeleton, footage.landmarks(), tracked.motion, given, sequence.first_frame,
                         sequence.last_frame);
}

// ---- JSON ----

ordered_json costs_json(const std::vector<TermCost>& terms) {
  ordered_json costs;
  for (const TermCost& term : terms) costs[term.name] = term.cost;
  return costs;
}

ordered_json frame_json(long frame, const TrackedFrame& found) {
  return {{"frame", frame},
          {"state", to_string(found.state)},
          {"keypoints", found.keypoints},
          {"agreeing", found.inlier_ratio},
          {"keypoint_error_px", found.keypoint_error},
          {"steps", found.iterations},
          {"stopped_by", to_string(found.reason)},
          {"costs", costs_json(found.terms)}};
}

/// Adds one value to the entry of each frame.
void add_curve(ordered_json& frames, const char* key, const std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) frames[i][key] = values[i];
}

ordered_json surface_json(const TrackedSurface& surface) {
  ordered_json frames = ordered_json::array();
  for (const SurfaceFrame& frame : surface.frames)
    frames.push_back({{"IoU_pose", frame.posed_overlap},
                      {"IoU", frame.overlap},
                      {"steps", frame.iterations},
                      {"stopped_by", to_string(frame.reason)},
                      {"costs", costs_json(frame.terms)}});
  const SurfaceSummary summary = summarise(surface);
  return {{"IoU_pose", summary.posed_overlap},
          {"IoU", summary.overlap},
          {"steps_per_frame", summary.steps_per_frame},
          {"frames_per_second", summary.frames_per_second},
          {"per_frame", frames}};
}

ordered_json livecap_json(const SequenceReport& report) {
  const LivecapSummary summary = summarise_livecap(report);
  return {{"IoU_pose", summary.posed_overlap},
          {"IoU", summary.overlap},
          {"frames_per_second", summary.frames_per_second},
          {"milliseconds",
           {{"read", summary.read_ms},
            {"pose", summary.pose_ms},
            {"surface", summary.surface_ms},
            {"frame", summary.frame_ms}}}};
}

ordered_json live_json(const LiveFigures& live) {
  ordered_json changes = ordered_json::array();
  for (const auto& [image, state] : live.changes) changes.push_back({{"picture", image}, {"state", state}});
  return {{"source", live.source},
          {"pictures", live.images},
          {"dropped", live.dropped},
          {"frames_per_second", live.frames_per_second},
          {"latency_ms", {{"mean", live.latency_ms}, {"largest", live.largest_latency_ms}}},
          {"pictures_behind", live.behind},
          {"milliseconds",
           {{"capture", live.capture_ms},
            {"preprocess", live.preprocess_ms},
            {"detect", live.detect_ms},
            {"pose", live.pose_ms},
            {"surface", live.surface_ms}}},
          {"memory_mb", {{"after_100_frames", live.settled_megabytes}, {"at_the_end", live.final_megabytes}}},
          {"states", changes}};
}

/// State, costs and errors of every frame.
ordered_json frames_json(const SequenceReport& report) {
  const TrackedSequence& tracked = report.tracked;
  ordered_json frames = ordered_json::array();
  for (std::size_t i = 0; i < tracked.frames.size(); ++i)
    frames.push_back(frame_json(tracked.sequence.first_frame + static_cast<long>(i), tracked.frames[i]));
  if (report.difference) {
    add_curve(frames, "joints_mm", report.difference->frame_mm);
    add_curve(frames, "aligned_joints_mm", report.difference->frame_aligned_mm);
  }
  if (report.errors) {
    add_curve(frames, "pose_vertices_mm", report.errors->skinned);
    add_curve(frames, "vertices_mm", report.errors->tracked);
  }
  if (report.livecap)
    for (const LivecapOverlap& overlap : *report.livecap) {
      frames[overlap.frame]["IoU_of_pose"] = overlap.pose;
      frames[overlap.frame]["IoU_of_surface"] = overlap.surface;
    }
  return frames;
}

ordered_json to_json(const SequenceReport& report) {
  const TrackedSequence& tracked = report.tracked;
  ordered_json json{{"frames", tracked.frames.size()}, {"lost_frames", report.lost_frames()}};
  for (const FrameState state : {FrameState::tracked, FrameState::initialised, FrameState::recovered})
    json[to_string(state)] = tracked.count(state);
  if (!tracked.stopped.empty()) json["stopped"] = tracked.stopped;
  json["keypoint_error_px"] = report.keypoint_error();
  json["steps_per_frame"] = report.steps_per_frame();
  json["frames_per_second"] = report.frames_per_second();
  if (report.difference) {
    ordered_json& difference = json["against_given_motion"];
    difference = {{"landmarks_mm", report.difference->landmarks_mm},
                  {"aligned_landmarks_mm", report.difference->aligned_landmarks_mm}};
    if (report.difference->poses) difference.update(report.difference->poses->to_json());
  }
  if (report.errors) {
    json["against_true_surface"]["vertex_error_pose_mm"] = mean(report.errors->skinned);
    if (!report.errors->tracked.empty()) json["against_true_surface"]["vertex_error_mm"] = mean(report.errors->tracked);
  }
  if (report.live) {
    json["live"] = live_json(*report.live);
    return json;
  }
  json["per_frame"] = frames_json(report);
  if (tracked.surface) json["surface"] = surface_json(*tracked.surface);
  if (report.livecap) json["livecap"] = livecap_json(report);
  return json;
}

}  // namespace

MotionDifference compare_motions(const Skeleton& skeleton, const std::vector<Marker>& landmarks, const Motion& a,
                                 const Motion& b, long first_frame, long last_frame) {
  MotionDifference result;
  std::vector<torch::Tensor> all_a, all_b;
  for (long row = first_frame; row <= last_frame; ++row) {
    const auto f = as_size(row);
    all_a.push_back(tensor_of(landmark_positions(skeleton, landmarks, a.frames[f])));
    all_b.push_back(tensor_of(landmark_positions(skeleton, landmarks, b.frames[f])));
    const torch::Tensor aligned = align_similarity(all_a.back(), all_b.back());
    result.frame_mm.push_back(1e3 * (all_a.back() - all_b.back()).norm(2, -1).mean().item<double>());
    result.frame_aligned_mm.push_back(1e3 * (aligned - all_b.back()).norm(2, -1).mean().item<double>());
  }
  result.landmarks_mm = mean(result.frame_mm);
  result.aligned_landmarks_mm = mean(result.frame_aligned_mm);
  const std::vector<std::string> names = landmark_names(landmarks);
  if (!has_common_joints(names)) return result;
  const torch::Tensor rows = torch::tensor(common_joint_rows(names), torch::kInt64);
  result.poses = compare_poses(torch::cat(all_a).index_select(1, rows), torch::cat(all_b).index_select(1, rows));
  return result;
}

std::vector<long> SequenceReport::lost_frames() const {
  std::vector<long> lost;
  for (std::size_t i = 0; i < tracked.frames.size(); ++i)
    if (!tracked.frames[i].found()) lost.push_back(tracked.sequence.first_frame + static_cast<long>(i));
  return lost;
}

double SequenceReport::keypoint_error() const {
  double sum = 0.0;
  for (const TrackedFrame& frame : tracked.frames) sum += frame.keypoint_error;
  return sum / static_cast<double>(tracked.frames.size());
}

double SequenceReport::steps_per_frame() const {
  double sum = 0.0;
  for (const TrackedFrame& frame : tracked.frames) sum += frame.iterations;
  return sum / static_cast<double>(tracked.frames.size());
}

double SequenceReport::frames_per_second() const {
  const double seconds = tracked.times.fitting();
  return seconds > 0.0 ? static_cast<double>(tracked.frames.size()) / seconds : 0.0;
}

SurfaceSummary summarise(const TrackedSurface& surface) {
  const auto count = static_cast<double>(surface.frames.size());
  SurfaceSummary summary;
  for (const SurfaceFrame& frame : surface.frames) {
    summary.posed_overlap += frame.posed_overlap;
    summary.overlap += frame.overlap;
    summary.steps_per_frame += frame.iterations;
  }
  summary.posed_overlap /= count;
  summary.overlap /= count;
  summary.steps_per_frame /= count;
  summary.frames_per_second = surface.seconds > 0.0 ? count / surface.seconds : 0.0;
  return summary;
}

LivecapSummary summarise_livecap(const SequenceReport& report) {
  const TrackTimes& times = report.tracked.times;
  const auto count = static_cast<double>(report.tracked.frames.size());
  LivecapSummary summary;
  for (const LivecapOverlap& overlap : *report.livecap) {
    summary.posed_overlap += overlap.pose / static_cast<double>(report.livecap->size());
    summary.overlap += overlap.surface / static_cast<double>(report.livecap->size());
  }
  summary.frames_per_second = times.total > 0.0 ? count / times.total : 0.0;
  summary.read_ms = 1e3 * times.reading / count;
  summary.pose_ms = 1e3 * times.pose / count;
  summary.surface_ms = 1e3 * times.surface / count;
  summary.frame_ms = 1e3 * times.total / count;
  return summary;
}

SequenceReport report_of(const Footage& footage, TrackedSequence tracked) {
  SequenceReport report;
  report.difference = difference_from_given(footage, tracked);
  report.errors = surface_errors(footage, tracked.sequence, tracked.motion, tracked.vertices);
  report.tracked = std::move(tracked);
  return report;
}

bool is_stopped(const TrackReport& report) {
  return !report.sequences.empty() && !report.sequences.back().tracked.stopped.empty();
}

ordered_json to_json(const TrackReport& report) {
  ordered_json json{{"method", report.method}};
  if (!report.steps.empty()) json["steps"] = report.steps;
  json["sequences"] = ordered_json::object();
  for (const auto& [name, value] : report.shared_dofs) json["usual"][name] = value;
  for (const auto& [name, value] : report.bone_scales) json["bone_scales"][name] = value;
  for (const SequenceReport& sequence : report.sequences)
    json["sequences"][sequence.tracked.sequence.name] = to_json(sequence);
  return json;
}

}  // namespace doppel
