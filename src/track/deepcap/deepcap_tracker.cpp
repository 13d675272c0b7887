#include "doppel/track/deepcap/deepcap_tracker.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/render/projection.h"
#include "doppel/track/energy/inliers.h"
#include "doppel/track/fit/pose_fit_options.h"

namespace doppel {

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

}  // namespace

DeepcapTracker::DeepcapTracker(TrainedPose& trained, const PinholeCamera& camera, const std::vector<Marker>& landmarks)
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
    const Keypoint& keypoint = keypoints[source_[m]];
    const auto row = seen[0][0][static_cast<std::int64_t>(m)];
    row[0] = keypoint.x;
    row[1] = keypoint.y;
    row[2] = keypoint.confidence;
  }
  const Tensor projection = projection_tensor({camera_}).unsqueeze(0);
  const Tensor centre = tensor_of_matrix(camera_.centre()).transpose(1, 2).contiguous();
  return {input.image.unsqueeze(0), tensor_of_matrix(camera_.R), keypoint_rays(seen, projection, centre), Tensor()};
}

FrameResult DeepcapTracker::capture(const cv::Mat& image, const cv::Mat& mask, const std::vector<Keypoint>& keypoints) {
  const torch::NoGradGuard no_grad;
  const PersonInput input = person_input(image, mask, keypoints, camera_, trained_.input_size());
  const PersonView view = view_of(input, keypoints);
  const CapturedPose captured = trained_.capture(view);
  const Tensor dofs = trained_.dofs(captured);
  const auto [A, T] = trained_.deformation(view.image);
  FrameResult frame;
  frame.pose.dofs = values_of(dofs);
  frame.graph = values_of(torch::cat({A, T}, 2));
  if (!(input.valid && captured.valid.item<bool>() && dofs.isfinite().all().item<bool>())) return frame;
  frame.pose.state = FrameState::tracked;
  const Inliers inliers = count_inliers(model_, model_.pose(frame.pose.dofs, false), {camera_},
                                        {{keypoints, OutlineField()}}, PoseFitOptions().inlier_threshold);
  frame.pose.keypoints = inliers.keypoints;
  frame.pose.inlier_ratio = inliers.ratio;
  frame.pose.keypoint_error = inliers.error;
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

}  // namespace doppel
