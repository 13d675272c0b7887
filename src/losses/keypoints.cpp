#include "doppel/losses/keypoints.h"

#include "doppel/core/lower_case.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr double kReferenceWidth = 1024.0;  // scaled pixels of an image

/// Squared distances in scaled pixels, and the confidences of those that count.
struct Residuals {
  Tensor squared;     ///< [B,C,M]; 0 where it does not count
  Tensor confidence;  ///< [B,C,M]; likewise
  Tensor lost;        ///< [B,C,M] bool: the keypoint would count, but its landmark is nowhere in the image
};

Tensor or_zero(const Tensor& where, const Tensor& value) {
  return torch::where(where, value, torch::zeros_like(value));
}

Residuals residuals(const Tensor& points, const KeypointTarget& target, const KeypointLossOptions& options) {
  constexpr const char* kName = "keypoint_loss";
  check_shape(kName, "points", points, {-1, -1, 3}, "[B,M,3]");
  const int64_t B = points.size(0), M = points.size(1);
  check_shape(kName, "keypoints", target.keypoints, {B, -1, M, 3}, "[B,C,M,3]");
  const int64_t C = target.keypoints.size(1);
  check_shape(kName, "projection", target.projection, {B, C, 3, 4}, "[B,C,3,4]");
  check_shape(kName, "scale", target.scale, {B, C}, "[B,C]");
  const Tensor keypoints = target.keypoints.to(points.scalar_type());
  const Tensor projection = target.projection.to(points.scalar_type());
  const Tensor scale = target.scale.to(points.scalar_type()).unsqueeze(-1).unsqueeze(-1);

  const Tensor known = points.isfinite().all(-1);
  const Tensor seen =
      torch::matmul(or_zero(known.unsqueeze(-1), points).unsqueeze(1), projection.narrow(-1, 0, 3).transpose(-2, -1)) +
      projection.select(-1, 3).unsqueeze(2);  // [B,C,M,3]: u z, v z, z
  const Tensor depth = seen.narrow(-1, 2, 1);
  const Tensor confidence = keypoints.select(-1, 2);
  // A point that was not detected has confidence 0 and counts nowhere, whatever the threshold.
  const Tensor wanted = (confidence >= options.confidence_threshold) & (confidence > 0) & keypoints.isfinite().all(-1);
  const Tensor counts = wanted & known.unsqueeze(1) & (depth.squeeze(-1) > options.nearest_depth);
  const Tensor pixel = seen.narrow(-1, 0, 2) / torch::where(counts.unsqueeze(-1), depth, torch::ones_like(depth));
  const Tensor off = or_zero(counts.unsqueeze(-1), scale * (pixel - keypoints.narrow(-1, 0, 2)));
  return {off.square().sum(-1), or_zero(counts, confidence), wanted & ~counts};
}

Tensor cameras_that_count(const Residuals& found) { return (found.confidence > 0).any(-1).sum(); }

}  // namespace

Tensor keypoint_loss(const Tensor& points, const KeypointTarget& target, const Tensor& lambda,
                     const KeypointLossOptions& options) {
  const Residuals found = residuals(points, target, options);
  Tensor weight = found.confidence;
  if (lambda.defined()) {
    check_shape("keypoint_loss", "lambda", lambda, {points.size(1)}, "[M]");
    weight = weight * lambda.to(points.scalar_type());
  }
  return (weight * found.squared).sum() / cameras_that_count(found).clamp_min(1);
}

std::int64_t keypoint_cameras(const Tensor& points, const KeypointTarget& target, const KeypointLossOptions& options) {
  const torch::NoGradGuard no_grad;
  return cameras_that_count(residuals(points, target, options)).item<std::int64_t>();
}

Tensor keypoint_error(const Tensor& points, const KeypointTarget& target, const KeypointLossOptions& options) {
  const torch::NoGradGuard no_grad;
  const Residuals found = residuals(points, target, options);
  const Tensor sum = found.squared.sqrt().sum() + kReferenceWidth * found.lost.sum();
  return sum / ((found.confidence > 0) | found.lost).sum().clamp_min(1);
}

LandmarkKind landmark_kind(const std::string& name) {
  const std::string lower = lower_case(name);
  const auto holds = [&](const char* word) { return lower.find(word) != std::string::npos; };
  if (holds("neck") || holds("shoulder") || holds("hip")) return LandmarkKind::torso;
  if (holds("elbow") || holds("knee")) return LandmarkKind::elbow_or_knee;
  return LandmarkKind::other;
}

Tensor landmark_weights(const std::vector<std::string>& names, double progress) {
  Tensor weights = torch::full({static_cast<int64_t>(names.size())}, 3.0f);
  if (progress >= 1.0 / 3.0) return weights;
  for (std::size_t m = 0; m < names.size(); ++m) {
    const LandmarkKind kind = landmark_kind(names[m]);
    weights[static_cast<int64_t>(m)] = kind == LandmarkKind::torso           ? 3.0f
                                       : kind == LandmarkKind::elbow_or_knee ? 2.0f
                                                                             : 1.0f;
  }
  return weights;
}

}  // namespace doppel
