#include "doppel/layers/global_alignment/global_alignment.h"
#include "doppel/layers/global_alignment/global_alignment_checks.h"
#include "doppel/layers/transform_math.h"

namespace doppel {
namespace {

using torch::Tensor;

/// The adjugate of 3x3 matrices [...,3,3], and their determinant [...].
struct Adjugate {
  explicit Adjugate(const Tensor& matrix) {
    const std::vector<Tensor> rows = matrix.unbind(-2);
    const Tensor first = torch::linalg_cross(rows[1], rows[2], -1);
    value =
        torch::stack({first, torch::linalg_cross(rows[2], rows[0], -1), torch::linalg_cross(rows[0], rows[1], -1)}, -1);
    determinant = (rows[0] * first).sum(-1);
  }
  Tensor inverse() const { return value / determinant.unsqueeze(-1).unsqueeze(-1); }
  Tensor value, determinant;
};

Tensor frobenius(const Tensor& matrix) { return matrix.square().sum({-2, -1}).sqrt(); }
Tensor times(const Tensor& matrix, const Tensor& vector) { return (matrix * vector.unsqueeze(-2)).sum(-1); }
Tensor finite_or_zero(const Tensor& value) { return torch::where(value.isfinite(), value, torch::zeros_like(value)); }

/// sigma of 5.2 [B,C,M]: 0 for rays that do not count.
Tensor ray_weights(const LandmarkRays& rays, const GlobalAlignmentOptions& options) {
  const Tensor& sigma = rays.confidence;
  const Tensor counts = (sigma >= options.confidence_threshold) & (sigma > 0.0) & sigma.isfinite() &
                        rays.direction.isfinite().all(-1) & rays.origin.isfinite().all(-1).unsqueeze(-1);
  return torch::where(counts, options.binary ? torch::ones_like(sigma) : sigma, torch::zeros_like(sigma));
}

/// The normal equations of 5.2, divided by trace(A)/3.
struct NormalEquations {
  NormalEquations(const Tensor& points, const LandmarkRays& rays, const Tensor& sigma) {
    const Tensor direction = finite_or_zero(rays.direction);
    const Tensor identity = torch::eye(3, points.options());
    const Tensor projector =
        sigma.unsqueeze(-1).unsqueeze(-1) * (identity - direction.unsqueeze(-1) * direction.unsqueeze(-2));
    const Tensor per_landmark = projector.sum(1), per_camera = projector.sum(2);
    matrix = per_landmark.sum(1);
    const Tensor trace = (matrix * identity).sum({-2, -1});
    const Tensor scale = torch::where(trace > 0.0, trace / 3.0, torch::ones_like(trace)).unsqueeze(-1);
    matrix = matrix / scale.unsqueeze(-1);
    right = (times(per_camera, finite_or_zero(rays.origin)).sum(1) - times(per_landmark, points).sum(1)) / scale;
  }
  Tensor matrix;  ///< [B,3,3]
  Tensor right;   ///< [B,3]
};

}  // namespace

LandmarkRays keypoint_rays(const Tensor& keypoints, const Tensor& projection, const Tensor& centre) {
  constexpr const char* kName = "keypoint_rays";
  check_shape(kName, "keypoints", keypoints, {-1, -1, -1, 3}, "[B,C,M,3]");
  check_shape(kName, "projection", projection, {keypoints.size(0), keypoints.size(1), 3, 4}, "[B,C,3,4]");
  check_shape(kName, "centre", centre, {keypoints.size(0), keypoints.size(1), 3}, "[B,C,3]");
  const torch::NoGradGuard no_grad;
  const Tensor exact = keypoints.to(torch::kFloat64);
  const Tensor pixel = torch::cat({exact.narrow(-1, 0, 2), torch::ones_like(exact.narrow(-1, 2, 1))}, -1);
  // d ~ (K R)^-1 (u,v,1). The determinant of K R is positive, and the adjugate does not depend on the matrix's sign.
  const Tensor adjugate = Adjugate(rotation_of(projection.to(torch::kFloat64))).value;
  const Tensor along = torch::matmul(pixel, adjugate.transpose(-2, -1));
  const Tensor length = along.square().sum(-1, true).sqrt();
  const Tensor seen = exact.isfinite().all(-1) & (length.squeeze(-1) > 0.0) & length.squeeze(-1).isfinite();
  LandmarkRays rays;
  rays.origin = centre.to(torch::kFloat64);
  rays.direction = torch::where(seen.unsqueeze(-1), along / length, torch::zeros_like(along));
  rays.confidence = torch::where(seen, exact.select(-1, 2), torch::zeros_like(exact.select(-1, 2)));
  return rays;
}

GlobalAlignment global_alignment_reference(const Tensor& points, const LandmarkRays& rays, const Tensor& prior,
                                           const GlobalAlignmentOptions& options) {
  check_alignment_arguments(points, rays, prior);
  const Tensor exact = points.to(torch::kFloat64);
  const Tensor finite = exact.isfinite().all(-1).all(-1);
  const Tensor sigma = ray_weights(rays, options);
  const NormalEquations system(finite_or_zero(exact), rays, sigma);

  const Adjugate adjugate(system.matrix);
  const Tensor well_conditioned =
      (adjugate.determinant > 0.0) &
      (frobenius(system.matrix) * frobenius(adjugate.value) <= options.largest_condition * adjugate.determinant);
  const Tensor valid = finite & ((sigma > 0.0).sum({1, 2}) >= 2) & well_conditioned;
  const Tensor pull = options.damping * valid.logical_not().to(torch::kFloat64).unsqueeze(-1);
  const Tensor damped = system.matrix + pull.unsqueeze(-1) * torch::eye(3, exact.options());
  const Tensor towards = prior.defined() ? finite_or_zero(prior.to(torch::kFloat64)) : torch::zeros_like(system.right);
  const Tensor translation = times(Adjugate(damped).inverse(), system.right + pull * towards);
  return {torch::where(valid.unsqueeze(-1), translation, translation.detach()).to(points.scalar_type()), valid};
}

}  // namespace doppel
