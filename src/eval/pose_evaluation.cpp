#include "doppel/eval/pose_evaluation.h"

#include <algorithm>
#include <limits>

#include "doppel/character/landmarks.h"
#include "doppel/core/progress.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/eval/mean.h"
#include "doppel/eval/pose_metrics.h"

namespace doppel {

namespace {

using Json = nlohmann::ordered_json;
using torch::Tensor;

Tensor true_dofs(const Batch& batch) { return batch.dofs.select(1, -1).contiguous(); }

class PoseEvaluation {
 public:
  PoseEvaluation(const Dataset& dataset, TrainedPose& trained, Split split, const EvaluationOptions& options)
      : dataset_(dataset),
        trained_(trained),
        split_(split),
        options_(options),
        known_(poses_are_known(dataset, split)),
        cameras_(dataset.camera_indices(options.cameras)),
        graph_landmarks_(trained.character, trained.landmarks) {}

  Json run() {
    look_at_poses();
    Json result;
    result["posenet"] = method(false);
    if (trained_.defnet) result["defnet"] = method(true);
    return result;
  }

 private:
  /// The views of the input camera for samples.
  Batch seen(const std::vector<SampleId>& samples) const {
    return person_batch(dataset_, samples, {dataset_.camera_index(options_.input_camera)}, trained_.input_size());
  }

  /// Evaluates poses frame by frame: joints against the true joints, landmarks against keypoints.
  void look_at_poses() {
    const std::vector<SampleId> samples = evaluated_samples(dataset_, split_, options_);
    std::vector<Tensor> found, ground_truth;
    Progress progress("poses, " + to_string(split_), static_cast<std::int64_t>(samples.size()));
    for (const SampleId& sample : samples) {
      const Batch batch = seen({sample});
      const CapturedPose captured = trained_.capture(person_view(batch));
      const bool valid = (captured.valid & batch.person_valid).item<bool>();
      if (valid)
        compare_landmarks(sample, batch, captured);
      else
        ++without_pose_;
      if (known_) {
        const Tensor joints = joints_of(captured.landmarks);
        found.push_back(valid ? joints : torch::full_like(joints, std::numeric_limits<float>::quiet_NaN()));
        ground_truth.push_back(joints_of(trained_.landmark_layer->forward(true_dofs(batch))));
      }
      progress.advance(1);
    }
    if (known_) scores_ = compare_poses(torch::cat(found), torch::cat(ground_truth)).to_json();
  }

  Tensor joints_of(const Tensor& landmarks) const {
    const std::vector<std::int64_t> rows = common_joint_rows(landmark_names(trained_.landmarks));
    return landmarks.index_select(1, torch::tensor(rows, torch::kInt64));
  }

  /// Distances of landmarks from keypoints in all compared cameras: for landmarks of the pose, and for landmarks that
  /// move with the deformed graph.
  void compare_landmarks(const SampleId& sample, const Batch& batch, const CapturedPose& captured) {
    BatchOptions options;
    options.past_frames = 0;
    options.keypoints = true;
    const Batch all = make_batch(dataset_, {sample}, {cameras_}, options);
    const KeypointTarget target = keypoint_target(all, captured.valid);
    if (!(all.keypoints.select(-1, 2) >= trained_.detections.loss.confidence_threshold).any().item<bool>()) return;
    const auto error = [&](const Tensor& landmarks) {
      return keypoint_error(landmarks, target, trained_.detections.loss).item<double>();
    };
    posed_error_.add(error(captured.landmarks));
    if (!trained_.defnet) return;
    const auto [A, T] = trained_.deformation(batch.person.select(1, 0));
    const Tensor nodes = trained_.surface->node_transforms(trained_.dofs(captured));
    deformed_error_.add(error(graph_landmarks_->forward(A, T, nodes)));
  }

  /// Moves a pose so that its root (root_of_joints) is at the true position. The pivot of the skeleton's root is no
  /// measure of this: it may be far from the hips, and other joints may turn against it.
  void move_to_ground_truth(CapturedPose& captured, const Tensor& ground_truth) const {
    captured.position = trained_.pose->position(ground_truth);
    const auto root = [this](const Tensor& dofs) {
      return root_of_joints(joints_of(trained_.landmark_layer->forward(dofs))).squeeze(1);
    };
    captured.position = captured.position + root(ground_truth) - root(trained_.dofs(captured));
  }

  Tensor surface(const std::vector<SampleId>& samples, bool deformed) {
    const Batch batch = seen(samples);
    CapturedPose captured = trained_.capture(person_view(batch));
    if (known_) move_to_ground_truth(captured, true_dofs(batch));
    const Tensor dofs = trained_.dofs(captured);
    if (!deformed) return trained_.surface->skinned(dofs);
    const auto [A, T] = trained_.deformation(batch.person.select(1, 0));
    return trained_.surface->deformed(dofs, A, T);
  }

  Json method(bool deformed) {
    const auto drawn = [&](const std::vector<SampleId>& samples) { return surface(samples, deformed); };
    const auto skinned = [&](const std::vector<SampleId>& samples) { return surface(samples, false); };
    const std::string title = std::string(deformed ? "defnet, " : "posenet, ") + to_string(split_);
    Json json = evaluate_surface(dataset_, split_, trained_.character, drawn, options_, title, skinned).to_json();
    if (without_pose_ > 0) json["frames_without_pose"] = without_pose_;
    const Mean& error = deformed ? deformed_error_ : posed_error_;
    if (error.count > 0) json["keypoint_error_px"] = error.value();
    for (const auto& [key, value] : scores_.items())
      if (key != "frames" && key != "missing") json[key] = value;
    return json;
  }

  const Dataset& dataset_;
  TrainedPose& trained_;
  Split split_;
  const EvaluationOptions& options_;
  bool known_;
  std::vector<int> cameras_;
  GraphLandmarks graph_landmarks_;
  Json scores_ = Json::object();  ///< of captured poses against known poses
  Mean posed_error_, deformed_error_;
  long without_pose_ = 0;
};

}  // namespace

bool poses_are_known(const Dataset& dataset, Split split) {
  return std::all_of(dataset.sequences().begin(), dataset.sequences().end(),
                     [&](const DatasetSequence& sequence) { return sequence.split != split || sequence.has_motion(); });
}

Json evaluate_pose_run(const Dataset& dataset, TrainedPose& trained, Split split, const EvaluationOptions& options) {
  const torch::NoGradGuard no_grad;
  return PoseEvaluation(dataset, trained, split, options).run();
}

}  // namespace doppel
