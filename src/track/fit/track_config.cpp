#include "doppel/track/fit/track_config.h"

namespace doppel {
namespace {

constexpr const char* kKernelMeaning = "scale of the Geman-McClure kernel, pixels; 0: squared distances";

void describe_contour(const Keys& keys, double& weight, double& reach) {
  keys("contour.weight", weight, between(0.0, kMaxWeight),
       "outline of the mask to that of the surface, per squared pixel");
  keys("contour.reach", reach, between(1e-3, 1e6),
       "largest distance of a contour pixel from its outline vertex, pixels");
}

void describe_surface(const Keys& keys, SurfaceOptions& surface) {
  const Range<double> weights = between(0.0, kMaxWeight), scales = between(0.0, 1e6);
  keys("keypoints.weight", surface.keypoint_weight, weights, "landmarks on the nodes to keypoints, per squared pixel");
  keys("keypoints.scale", surface.keypoint_scale, scales, kKernelMeaning);
  keys("silhouette.weight", surface.silhouette_weight, weights,
       "outline of the surface to that of the mask, per squared pixel");
  keys("silhouette.scale", surface.silhouette_scale, scales, kKernelMeaning);
  describe_contour(keys, surface.contour_weight, surface.contour_reach);
  keys("arap.weight", surface.arap_weight, weights, "rigidity of the graph, per squared metre");
  keys("temporal.weight", surface.temporal_weight, weights, "nodes to the last frame, per squared metre");
  keys("rest.weight", surface.rest_weight, weights, "nodes to no deformation, per squared metre");
  keys("vertices", surface.outline_vertices, between(1, 1000000), "largest number of outline vertices in a camera");
  keys("rounds", surface.rounds, between(0, 100), "how often outline vertices are found in a frame");
  describe_keys(keys.section("solver"), surface.solver);
}

}  // namespace

void describe_keys(const Keys& keys, TrackConfig& config) {
  MultiviewOptions& fit = config.fit;
  describe_pose_fit(keys, fit);
  keys("silhouette.inside", fit.silhouette_inside, between(0.0, 1.0),
       "factor of the weight of outline vertices inside the mask");
  keys("silhouette.rounds", fit.outline_rounds, between(0, 100),
       "how often outline vertices are found in a frame; 0: keypoints only");
  describe_contour(keys, fit.contour_weight, fit.contour_reach);
  keys("inliers.max_distance", fit.max_landmark_distance, between(1e-3, 1e3),
       "distance of a landmark from its triangulated position that starts a second fit, metres");
  describe_keys(keys, config.dofs);
  keys("shared_dofs.dofs", config.shared_dofs, "names of the DoFs that get one value for all frames");
  keys("shared_dofs.frames", config.shared_frames, between(1, 100000),
       "frames of each sequence that they are fitted to");
  keys("shared_dofs.weight", fit.shared_dofs.weight, between(0.0, kMaxWeight),
       "of the prior on shared DoFs that are unknowns of the second pass, per squared radian");
  keys("template_fit.frames", config.template_frames, between(0, 100000),
       "frames of each sequence for the template fit; 0: no template fit");
  keys("smoothing", config.smoothing, between(0.0, 1000.0), "sigma of the smoothing of poses, frames; 0: none");
  describe_surface(keys.section("surface"), config.surface);
}

TrackConfig read_track_config(const ConfigDocument& document, TrackConfig config) {
  const ConfigReader root = document.root();
  read_keys(root, config);
  root.finish();
  return config;
}

}  // namespace doppel
