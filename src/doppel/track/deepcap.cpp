#include "doppel/track/deepcap.h"

#include <algorithm>
#include <optional>

#include "doppel/core/error.h"
#include "doppel/core/progress.h"
#include "doppel/render/projection.h"
#include "doppel/track/agreement.h"
#include "doppel/track/clock.h"
#include "doppel/track/frame_file.h"
#include "doppel/track/pose_fit_options.h"
#include "doppel/track/pose_sequence.h"
#include "doppel/track/root_rotation.h"
#include "doppel/track/track_film.h"
#include "doppel/track/tracked_sequence.h"

namespace doppel {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using torch::Tensor;

namespace {

template <typename Matrix>
Tensor tensor_of_matrix(const Matrix& matrix) {
  Tensor tensor = torch::empty({1, matrix.rows(), matrix.cols()}, torch::kFloat32);
  for (int r = 0; r < matrix.rows(); ++r)
    for (int c = 0; c < matrix.cols(); ++c) tensor[0][r][c] = matrix(r, c);
  return tensor;
}

std::vector<double> values_of(const Tensor& tensor) {
  const Tensor flat = tensor.to(torch::kFloat64).contiguous();
  return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
}

/// A sequence from its pictures to its files.
class DeepcapRun {
 public:
  DeepcapRun(const Footage& footage, DeepcapTracker& tracker, const DeepcapOptions& options,
             const FootageSequence& sequence)
      : footage_(footage), tracker_(tracker), options_(options) {
    result_.sequence = sequence;
  }

  /// Both passes: networks, then, on what was smoothed, surfaces and film.
  void run(Progress& progress) {
    capture(progress);
    const auto root = RootRotation::of(footage_.character().skeleton);
    make_motion(result_, root, options_.smoothing);
    smooth_graphs();
    write_poses(footage_.character(), footage_.capture().fps, options_.out, result_);
    const fs::path stem = options_.out / result_.sequence.name;
    if (has_graph()) write_graphs(stem.string() + "_graph.npy");
    if (options_.film || options_.vertices) write_surfaces(stem, progress);
  }
  TrackedSequence take_result() { return std::move(result_); }

 private:
  void capture(Progress& progress) {
    const FootageSequence& sequence = result_.sequence;
    const auto reader = footage_.read(sequence.index);
    for (long frame = sequence.first_frame; frame <= sequence.last_frame; ++frame) {
      check_not_stopped(sequence, frame);
      const FootageFrame seen = reader->read(frame, true);
      if (seen.pictures.front().empty())
        fail("sequence {}: the camera {} has no pictures, which PoseNet looks at", sequence.name,
             footage_.cameras().front().name);
      const auto start = Clock::now();
      DeepcapFrame found = tracker_.capture(seen.pictures.front(), seen.masks.front(), seen.evidence.front().keypoints);
      result_.seconds += seconds_since(start);
      progress.advance(1, fmt::format("{} {}", sequence.name, to_string(found.pose.state)));
      result_.frames.push_back(std::move(found.pose));
      graphs_.push_back(std::move(found.graph));
    }
  }

  void smooth_graphs() {
    std::vector<bool> trusted;
    for (const TrackedFrame& frame : result_.frames) trusted.push_back(frame.trusted());
    const std::vector<long> cuts = result_.sequence.cuts_from_first();
    bridge_poses(graphs_, trusted, cuts, std::nullopt);
    smooth_poses(graphs_, cuts, std::nullopt, options_.smoothing);
  }

  bool has_graph() const {
    return std::any_of(graphs_.front().begin(), graphs_.front().end(), [](double value) { return value != 0.0; });
  }

  void write_graphs(const fs::path& path) const {
    FrameFile file(path, footage_.character().num_nodes(), 6);
    for (const std::vector<double>& graph : graphs_) file.append(graph);
    file.close();
  }

  void write_surfaces(const fs::path& stem, Progress& progress) {
    const FootageSequence& sequence = result_.sequence;
    const TriangleMesh& mesh = footage_.character().mesh;
    std::optional<FrameFile> vertices;
    std::optional<TrackFilm> film;
    if (options_.vertices) {
      result_.vertices = stem.string() + "_vertices.npy";
      vertices.emplace(result_.vertices, mesh.num_vertices(), 3);
    }
    if (options_.film)
      film.emplace(stem.string() + ".mp4", footage_.cameras().front(), mesh, footage_.capture().fps, options_.view);
    const auto reader = options_.film ? footage_.read(sequence.index) : nullptr;
    for (long frame = sequence.first_frame; frame <= sequence.last_frame; ++frame) {
      check_not_stopped(sequence, frame);
      const Tensor surface = tracker_.surface(result_.motion.frames[static_cast<std::size_t>(frame)],
                                              graphs_[static_cast<std::size_t>(frame - sequence.first_frame)]);
      if (vertices) vertices->append(surface.data_ptr<float>());
      if (film) film->add(reader->picture(frame, 0), surface);
      progress.advance(1, sequence.name);
    }
    if (vertices) vertices->close();
    if (film) film->close();
  }

  const Footage& footage_;
  DeepcapTracker& tracker_;
  const DeepcapOptions& options_;
  TrackedSequence result_;
  std::vector<std::vector<double>> graphs_;  ///< [frames][K*6]
};

}  // namespace

DeepcapTracker::DeepcapTracker(TrainedPose& trained, const Camera& camera, const std::vector<Marker>& landmarks)
    : trained_(trained), camera_(camera), model_(trained.character, landmarks, {}) {
  for (const Marker& wanted : trained.landmarks) {
    const auto found =
        std::find_if(landmarks.begin(), landmarks.end(), [&](const Marker& m) { return m.name == wanted.name; });
    if (found == landmarks.end())
      fail("the capture has no landmark '{}', which PoseNet was trained with; use the same placement file and map",
           wanted.name);
    source_.push_back(static_cast<int>(found - landmarks.begin()));
  }
}

PersonView DeepcapTracker::view_of(const PersonInput& input, const std::vector<Keypoint>& keypoints) const {
  Tensor seen = torch::zeros({1, 1, static_cast<std::int64_t>(source_.size()), 3});
  for (std::size_t m = 0; m < source_.size(); ++m) {
    const Keypoint& keypoint = keypoints[static_cast<std::size_t>(source_[m])];
    const auto row = seen[0][0][static_cast<std::int64_t>(m)];
    row[0] = keypoint.x;
    row[1] = keypoint.y;
    row[2] = keypoint.confidence;
  }
  const Tensor projection = projection_tensor({camera_}).unsqueeze(0);
  const Tensor centre = tensor_of_matrix(camera_.centre()).transpose(1, 2).contiguous();
  return {input.picture.unsqueeze(0), tensor_of_matrix(camera_.R), keypoint_rays(seen, projection, centre), Tensor()};
}

DeepcapFrame DeepcapTracker::capture(const cv::Mat& picture, const cv::Mat& mask,
                                     const std::vector<Keypoint>& keypoints) {
  const torch::NoGradGuard no_grad;
  const PersonInput input = person_input(picture, mask, keypoints, camera_, trained_.input_size());
  const PersonView view = view_of(input, keypoints);
  const CapturedPose captured = trained_.capture(view);
  const Tensor dofs = trained_.dofs(captured);
  const auto [A, T] = trained_.deformation(view.image);
  DeepcapFrame frame;
  frame.pose.dofs = values_of(dofs);
  frame.graph = values_of(torch::cat({A, T}, 2));
  if (!(input.valid && captured.valid.item<bool>() && dofs.isfinite().all().item<bool>())) return frame;
  frame.pose.state = FrameState::tracked;
  const Agreement agreement = agreement_of(model_, model_.pose(frame.pose.dofs, false), {camera_},
                                           {{keypoints, OutlineField()}}, PoseFitOptions().agreement);
  frame.pose.keypoints = agreement.keypoints;
  frame.pose.agreeing = agreement.share;
  frame.pose.keypoint_error = agreement.error;
  return frame;
}

Tensor DeepcapTracker::surface(const std::vector<double>& dofs, const std::vector<double>& graph) const {
  const torch::NoGradGuard no_grad;
  const auto row = [](const std::vector<double>& values) {
    return torch::tensor(values, torch::kFloat64).to(torch::kFloat32).unsqueeze(0);
  };
  const Tensor nodes = row(graph).view({1, -1, 6});
  const Tensor A = nodes.slice(2, 0, 3).contiguous(), T = nodes.slice(2, 3, 6).contiguous();
  return trained_.surface->deformed(row(dofs), A, T)[0].contiguous();
}

ordered_json track_deepcap(const Footage& footage, const DeepcapOptions& options) {
  check_one_camera(footage);
  TrainedPose trained = TrainedPose::load(options.run);
  if (trained.character.fingerprint() != footage.character().fingerprint())
    fail("{} was trained for another character than the capture's", options.run.string());
  open_out_folder(footage, options.out);
  DeepcapTracker tracker(trained, footage.cameras().front(), footage.landmarks());
  const std::vector<FootageSequence> chosen = chosen_sequences(footage, options);
  Progress progress("track", count_frames(chosen) * (options.film || options.vertices ? 2 : 1));
  ordered_json report{{"method", "deepcap"}, {"steps", trained.steps}, {"sequences", ordered_json::object()}};
  std::vector<TrackedSequence> tracked;
  for (const FootageSequence& sequence : chosen) {
    DeepcapRun run(footage, tracker, options, sequence);
    run.run(progress);
    tracked.push_back(run.take_result());
    report["sequences"][sequence.name] = report_of(footage, tracked.back());
  }
  progress.finish();
  write_results(footage, options.out, tracked, report);
  return report;
}

}  // namespace doppel
