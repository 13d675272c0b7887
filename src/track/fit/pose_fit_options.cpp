#include "doppel/track/fit/pose_fit_options.h"

#include <cmath>
#include <utility>

#include "doppel/core/error.h"

namespace doppel {

void check_not_negative(const char* name, double value) {
  if (!(value >= 0.0) || !std::isfinite(value)) fail("the {} of the fit is {}; it must be 0 or more", name, value);
}

void check_fit(const PoseFitOptions& o) {
  const std::pair<const char*, double> numbers[] = {{"keypoint weight", o.keypoint_weight},
                                                    {"silhouette weight", o.silhouette_weight},
                                                    {"limit weight", o.limit_weight},
                                                    {"temporal weight", o.temporal_weight},
                                                    {"steady weight", o.steady_weight},
                                                    {"prior weight", o.prior_weight},
                                                    {"keypoint scale", o.keypoint_scale},
                                                    {"silhouette scale", o.silhouette_scale},
                                                    {"smallest inlier ratio", o.min_inlier_ratio}};
  for (const auto& [name, value] : numbers) check_not_negative(name, value);
  if (!(o.inlier_threshold > 0.0))
    fail("the inlier threshold of the fit is {}; it must be more than 0", o.inlier_threshold);
  if (o.outline_pixels < 16 || o.outline_vertices < 1)
    fail("the fit needs outline windows of at least 16 pixels and at least 1 outline vertex");
}

void describe_pose_fit(const Keys& keys, PoseFitOptions& o, const ConfigUnits& units) {
  const Range<double> weights = between(0.0, kMaxWeight);
  const std::string kernel = fmt::format("scale of the Geman-McClure kernel, {}; 0: squared distances", units.pixels);
  keys("keypoints.weight", o.keypoint_weight, weights, "landmarks to keypoints, per squared pixel",
       units.per_squared_pixel);
  keys("keypoints.scale", o.keypoint_scale, between(0.0, 1e6), kernel, units.to_pixels);
  keys("silhouette.weight", o.silhouette_weight, weights,
       "outline of the surface to that of the mask, per squared pixel", units.per_squared_pixel);
  keys("silhouette.scale", o.silhouette_scale, between(0.0, 1e6), kernel, units.to_pixels);
  keys("silhouette.pixels", o.outline_pixels, between(16, 4096), "side of the windows in which outlines are drawn");
  keys("silhouette.vertices", o.outline_vertices, between(1, 1000000),
       "largest number of outline vertices in a camera");
  keys("limits.weight", o.limit_weight, weights, "DoFs beyond their limits, per squared radian");
  keys("temporal.weight", o.temporal_weight, weights,
       fmt::format("landmarks to their expected positions, per {}", units.squared_length), units.per_squared_length);
  keys("steady.weight", o.steady_weight, weights, "DoFs to their predicted values, per squared radian");
  keys("prior.weight", o.prior_weight, weights, "DoFs to the rest pose, per squared radian");
  describe_keys(keys.section("solver"), o.solver);
  keys("inliers.threshold", o.inlier_threshold, between(1e-3, 1e6),
       fmt::format("largest distance of an inlier from its landmark, {}", units.pixels), units.to_pixels);
  keys("inliers.min_ratio", o.min_inlier_ratio, between(0.0, 1.0),
       "inliers among the confident keypoints; below, the frame is lost");
  keys("inliers.min_keypoints", o.min_keypoints, between(1, 1000000), "confident keypoints; below, the frame is lost");
}

void describe_keys(const Keys& keys, SolverOptions& o) {
  keys("iterations", o.iterations, between(1, 10000), "largest number of steps");
  keys("damping", o.initial_damping, between(0.0, 1e6), "initial damping, relative to the diagonal of J^T J");
  keys("function_tolerance", o.function_tolerance, between(0.0, 1.0),
       "the fit ends when a step lowers the cost by this share or less");
}

}  // namespace doppel
