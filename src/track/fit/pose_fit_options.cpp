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

void read_pose_fit(const ConfigReader& root, PoseFitOptions& o, const ConfigUnits& units) {
  read_image_term(root, "keypoints", o.keypoint_weight, o.keypoint_scale, units);
  read_image_term(root, "silhouette", o.silhouette_weight, o.silhouette_scale, units);
  const ConfigReader silhouette = root.section("silhouette");
  o.outline_pixels = silhouette.get("pixels", o.outline_pixels, between(16, 4096));
  o.outline_vertices = silhouette.get("vertices", o.outline_vertices, between(1, 1000000));
  read_weight(root, "limits", o.limit_weight);
  read_weight(root, "temporal", o.temporal_weight, units.per_squared_length);
  read_weight(root, "steady", o.steady_weight);
  read_weight(root, "prior", o.prior_weight);
  read_solver(root.section("solver"), o.solver);
  const ConfigReader inliers = inlier_section(root);
  read_number(inliers, "threshold", o.inlier_threshold, between(1e-3, 1e6), units.pixels);
  o.min_inlier_ratio = inliers.get("min_ratio", o.min_inlier_ratio, between(0.0, 1.0));
  o.min_keypoints = inliers.get("min_keypoints", o.min_keypoints, between(1, 1000000));
}

}  // namespace doppel
