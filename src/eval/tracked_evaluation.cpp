#include "doppel/eval/tracked_evaluation.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "doppel/character/landmarks.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/capture.h"
#include "doppel/eval/error_map.h"
#include "doppel/eval/ground_truth.h"
#include "doppel/eval/pose_evaluation.h"
#include "doppel/eval/pose_metrics.h"
#include "doppel/geometry/image_file.h"
#include "doppel/layers/landmarks/landmarks.h"
#include "doppel/layers/pose_dofs.h"
#include "doppel/layers/surface.h"
#include "doppel/render/mesh/face_tensor.h"

namespace doppel {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using torch::Tensor;

namespace {

constexpr double kErrorMapLimit = 0.02;  // metres
constexpr long kSmoothedFrames = 2;      // on either side: five frames in all (5.8)

std::string method_of(const fs::path& report) {
  if (!fs::exists(report)) return "";
  const auto json = nlohmann::json::parse(read_file(report), nullptr, false);
  return json.is_object() ? json.value("method", "") : "";
}

/// @throws Error when a coordinate is not finite
void check_finite(const fs::path& path, const Tensor& vertices) {
  const Tensor bad = vertices.isfinite().logical_not().flatten(1).any(1).nonzero();
  if (bad.size(0) > 0)
    fail(
        "{}: row {} (counted from 0) has a vertex that is not finite; {} of {} rows have one. Track the sequence again",
        path.string(), bad[0].item<long>(), bad.size(0), vertices.size(0));
}

class TrackedEvaluation {
 public:
  TrackedEvaluation(const Dataset& dataset, const Character& character, const TrackedRun& tracked, Split split,
                    const TrackedEvaluationOptions& options)
      : dataset_(dataset),
        character_(character),
        tracked_(tracked),
        split_(split),
        options_(options),
        samples_(evaluated_samples(dataset, split, options)),
        known_(poses_are_known(dataset, split)),
        surface_(character),
        landmarks_(dataset.landmarks().empty() ? character.skeleton.markers : dataset.landmarks()),
        landmark_layer_(character.skeleton, landmarks_),
        faces_(face_tensor(character.mesh)) {
    const std::vector<std::string> names = landmark_names(landmarks_);
    if (has_common_joints(names)) rows_ = torch::tensor(common_joint_rows(names), torch::kInt64);
    if (known_ && !options.input_camera.empty())
      root_.emplace(character.skeleton, std::vector<std::string>{}, character.rest_dofs);
  }

  Json run() {
    const Json scores = pose_scores();
    Json rows;
    rows["pose"] = method("pose", scores, [this](const SampleId& sample) { return skinned(sample); });
    if (has_vertices())
      rows["surface"] = method("surface", scores, [this](const SampleId& sample) { return tracked_vertices(sample); });
    if (!options_.error_maps.empty()) draw_error_maps();
    return rows;
  }

 private:
  const std::string& name_of(const SampleId& sample) const { return dataset_.sequences()[sample.sequence].name; }
  const TrackedMotion& motion_of(const SampleId& sample) const { return tracked_.sequences.at(name_of(sample)); }

  bool has_vertices() const {
    return std::all_of(samples_.begin(), samples_.end(),
                       [this](const SampleId& sample) { return motion_of(sample).vertices.defined(); });
  }

  /// The frames that are averaged for a frame, with their weights: tracked frames of the same segment.
  std::vector<std::pair<long, double>> window(const SampleId& sample) const {
    if (options_.smoothing == 0.0) return {{sample.frame, 1.0}};
    const TrackedMotion& motion = motion_of(sample);
    const DatasetSequence& sequence = dataset_.sequences()[sample.sequence];
    std::vector<std::pair<long, double>> frames;
    double sum = 0.0;
    for (long i = -kSmoothedFrames; i <= kSmoothedFrames; ++i) {
      const long frame = sample.frame + i;
      if (frame < motion.first_frame || frame >= motion.motion.num_frames()) continue;
      if (sequence.segment_start(frame) != sequence.segment_start(sample.frame)) continue;
      const double x = static_cast<double>(i) / options_.smoothing;
      frames.emplace_back(frame, std::exp(-0.5 * x * x));
      sum += frames.back().second;
    }
    for (auto& [frame, weight] : frames) weight /= sum;
    return frames;
  }

  /// The weighted mean over the window of a frame. @param value of a frame, for its DoFs [1,D] and its row
  template <typename Value>
  Tensor smoothed(const SampleId& sample, const Value& value) const {
    Tensor sum;
    for (const auto& [frame, weight] : window(sample)) {
      const Tensor part = weight * value(frame);
      sum = sum.defined() ? sum + part : part;
    }
    return sum;
  }

  Tensor tracked_dofs(const SampleId& sample, long frame) const {
    return torch::tensor(motion_of(sample).motion.frames[frame], torch::kFloat32).unsqueeze(0);
  }
  Tensor true_dofs(const SampleId& sample) const { return dataset_.dof_window(sample, 0); }

  /// [1,14,3]
  Tensor joints(const Tensor& dofs) const { return landmark_layer_->forward(dofs).index_select(1, rows_); }
  /// The root of a pose [1,1,3], or the pivot of the skeleton's root if the landmarks do not have the common joints.
  Tensor root(const Tensor& dofs) const {
    return rows_.defined() ? root_of_joints(joints(dofs)) : root_->position(dofs).unsqueeze(1);
  }
  /// From the tracked to the true position of the root, [1,1,3]; 0 where the position is evaluated too.
  Tensor shift(const SampleId& sample, long frame) const {
    if (!root_) return torch::zeros({1, 1, 3});
    return root(true_dofs(sample)) - root(tracked_dofs(sample, frame));
  }

  Tensor skinned(const SampleId& sample) {
    return smoothed(sample,
                    [&](long frame) { return surface_->skinned(tracked_dofs(sample, frame)) + shift(sample, frame); });
  }
  Tensor tracked_vertices(const SampleId& sample) {
    const TrackedMotion& motion = motion_of(sample);
    return smoothed(sample, [&](long frame) {
      return motion.vertices[frame - motion.first_frame].unsqueeze(0) + shift(sample, frame);
    });
  }

  void draw_error_maps() {
    GroundTruth ground_truth(dataset_, options_.ground_truth);
    const int camera = options_.input_camera.empty() ? dataset_.camera_indices(options_.cameras).front()
                                                     : dataset_.camera_index(options_.input_camera);
    for (const SampleId& sample : samples_) {
      const Tensor skin = skinned(sample)[0], expected = ground_truth.at(sample, skin.size(0));
      const Tensor surface = tracked_vertices(sample)[0];
      const cv::Mat map = draw_vertex_values(surface, faces_, error_improvement(surface, skin, expected),
                                             dataset_.camera(camera), kErrorMapLimit);
      write_image(options_.error_maps / fmt::format("{}_{:06}.png", name_of(sample), sample.frame), map);
    }
  }

  Json pose_scores() {
    if (!known_ || !rows_.defined()) return Json::object();
    std::vector<Tensor> found, ground_truth;
    for (const SampleId& sample : samples_) {
      found.push_back(smoothed(sample, [&](long frame) { return joints(tracked_dofs(sample, frame)); }));
      ground_truth.push_back(joints(true_dofs(sample)));
    }
    return compare_poses(torch::cat(found), torch::cat(ground_truth)).to_json();
  }

  template <typename Surface>
  Json method(const char* name, const Json& scores, const Surface& surface) {
    const auto drawn = [&](const std::vector<SampleId>& samples) {
      std::vector<Tensor> surfaces;
      for (const SampleId& sample : samples) surfaces.push_back(surface(sample));
      return torch::cat(surfaces);
    };
    const auto in_own_pose = [this](const std::vector<SampleId>& samples) { return skinned(samples.front()); };
    Json json = evaluate_surface(dataset_, split_, character_, drawn, options_,
                                 std::string(name) + ", " + to_string(split_), in_own_pose)
                    .to_json();
    for (const auto& [key, value] : scores.items())
      if (key != "frames" && key != "missing") json[key] = value;
    return json;
  }

  const Dataset& dataset_;
  const Character& character_;
  const TrackedRun& tracked_;
  Split split_;
  const TrackedEvaluationOptions& options_;
  std::vector<SampleId> samples_;
  bool known_;
  std::optional<PoseDofs> root_;  ///< where surfaces are moved to the true position
  CharacterSurface surface_;
  std::vector<Marker> landmarks_;
  Landmarks landmark_layer_;
  Tensor faces_;
  Tensor rows_;  ///< int64 [14] landmarks that are the common joints; undefined without them
};

}  // namespace

TrackedRun TrackedRun::load(const fs::path& folder, const Character& character) {
  if (!fs::exists(folder / "capture.yaml"))
    fail<UsageError>("--tracked {}: this folder has no capture.yaml; give the output folder of `doppel track`",
                     folder.string());
  const Capture capture = read_capture(folder / "capture.yaml");
  TrackedRun run;
  run.method = method_of(folder / "track.json");
  run.capture = capture.name;
  run.root = capture.root;
  for (const SequenceEntry& entry : capture.sequences) {
    const fs::path motion = folder / (entry.name + ".motion");
    if (!fs::exists(motion)) continue;
    TrackedMotion tracked{read_motion(motion, character.skeleton.num_dofs()), entry.first_frame, {}};
    const fs::path vertices = folder / (entry.name + "_vertices.npy");
    if (fs::exists(vertices)) {
      tracked.vertices = read_surfaces(vertices, character.num_vertices());
      check_finite(vertices, tracked.vertices);
    }
    const long rows = tracked.motion.num_frames() - tracked.first_frame;
    if (tracked.vertices.defined() && tracked.vertices.size(0) != rows)
      fail("{}: the file has {} frames, and the motion beside it has {} tracked ones; track the sequence again",
           vertices.string(), tracked.vertices.size(0), rows);
    run.sequences.emplace(entry.name, std::move(tracked));
  }
  if (run.sequences.empty())
    fail<UsageError>("--tracked {}: this folder has no tracked motion; give the output folder of `doppel track`",
                     folder.string());
  return run;
}

std::string TrackedRun::other_capture(const Capture& compared) const {
  std::error_code ignored;
  if (capture == compared.name && (root == compared.root || fs::equivalent(root, compared.root, ignored))) return "";
  return fmt::format("{} in {} was tracked, and {} in {} is compared", capture, root.string(), compared.name,
                     compared.root.string());
}

void check_tracked(const Dataset& dataset, const TrackedRun& tracked, Split split,
                   const TrackedEvaluationOptions& options) {
  const GroundTruth ground_truth(dataset, options.ground_truth);
  for (const SampleId& sample : evaluated_samples(dataset, split, options)) {
    const std::string& name = dataset.sequences()[sample.sequence].name;
    const auto found = tracked.sequences.find(name);
    if (found == tracked.sequences.end() || sample.frame < found->second.first_frame ||
        sample.frame >= found->second.motion.num_frames())
      fail<UsageError>(
          "--tracked: frame {} of sequence {} was not tracked; track it too, or name tracked frames with --frames",
          sample.frame, name);
    if (!options.error_maps.empty() && (!ground_truth.has(sample) || !found->second.vertices.defined()))
      fail<UsageError>(
          "--error-maps needs the true surface of {} in the capture, with the vertices of the character, and tracked "
          "surfaces (doppel track --vertices)",
          name);
  }
  if (!options.error_maps.empty()) fs::create_directories(options.error_maps);
}

Json evaluate_tracked(const Dataset& dataset, const Character& character, const TrackedRun& tracked, Split split,
                      const TrackedEvaluationOptions& options) {
  const torch::NoGradGuard no_grad;
  check_tracked(dataset, tracked, split, options);
  return TrackedEvaluation(dataset, character, tracked, split, options).run();
}

}  // namespace doppel
