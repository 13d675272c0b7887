#include "pose_evaluation.h"

#include <limits>

#include "doppel/core/progress.h"
#include "doppel/eval/pose_metrics.h"

namespace doppel::tools {

namespace {

using Json = nlohmann::ordered_json;
using torch::Tensor;

/// What the input camera shows of samples.
Batch seen_by(const Dataset& dataset, const TrainedPose& trained, const std::vector<SampleId>& samples,
              const std::string& camera) {
  return person_batch(dataset, samples, {dataset.camera_index(camera)}, trained.input_size());
}

Tensor true_dofs(const Batch& batch) { return batch.dofs.select(1, -1).contiguous(); }

PoseScores evaluate_poses(const Dataset& dataset, TrainedPose& trained, Split split, const EvaluationOptions& options) {
  const std::vector<SampleId> samples = evaluated_samples(dataset, split, options);
  std::vector<std::string> names;
  for (const Marker& landmark : trained.landmarks) names.push_back(landmark.name);
  const Tensor rows = torch::tensor(common_joint_rows(names), torch::kInt64);
  std::vector<Tensor> found, truth;
  Progress progress("poses, " + to_string(split), static_cast<std::int64_t>(samples.size()));
  for (const SampleId& sample : samples) {
    const Batch batch = seen_by(dataset, trained, {sample}, options.input_camera);
    const CapturedPose captured = trained.capture(person_view(batch));
    const bool valid = (captured.valid & batch.person_valid).item<bool>();
    const Tensor joints = captured.landmarks.index_select(1, rows);
    found.push_back(valid ? joints : torch::full_like(joints, std::numeric_limits<float>::quiet_NaN()));
    truth.push_back(trained.landmark_layer->forward(true_dofs(batch)).index_select(1, rows));
    progress.advance(1);
  }
  return compare_poses(torch::cat(found), torch::cat(truth));
}

Json with_poses(const PoseScores& poses, const SurfaceResult& surface) {
  Json json = surface.to_json();
  if (poses.missing > 0) json["frames_without_pose"] = poses.missing;
  const Json figures = poses.to_json();
  for (const auto& [key, value] : figures.items())
    if (key != "frames" && key != "missing") json[key] = value;
  return json;
}

}  // namespace

Json evaluate_pose_run(const Dataset& dataset, TrainedPose& trained, Split split, const EvaluationOptions& options) {
  const torch::NoGradGuard no_grad;
  const Tensor faces = face_tensor(trained.character);
  const PoseScores poses = evaluate_poses(dataset, trained, split, options);
  const auto surface = [&](bool deformed) {
    return [&, deformed](const std::vector<SampleId>& samples) {
      const Batch batch = seen_by(dataset, trained, samples, options.input_camera);
      CapturedPose captured = trained.capture(person_view(batch));
      captured.position = trained.pose->position(true_dofs(batch));
      const Tensor dofs = trained.dofs(captured);
      if (!deformed) return trained.surface->skinned(dofs);
      const auto [A, T] = trained.deformation(batch.person.select(1, 0));
      return trained.surface->deformed(dofs, A, T);
    };
  };
  Json result;
  result["posenet"] = with_poses(
      poses, evaluate_surface(dataset, split, faces, surface(false), options, "posenet, " + to_string(split)));
  if (trained.defnet)
    result["defnet"] = with_poses(
        poses, evaluate_surface(dataset, split, faces, surface(true), options, "defnet, " + to_string(split)));
  return result;
}

}  // namespace doppel::tools
