#include "doppel/track/fit/track_config.h"

#include "doppel/track/fit/config_terms.h"

namespace doppel {
namespace {

void read_contour(const ConfigReader& reader, double& weight, double& reach) {
  read_weight(reader, "contour", weight);
  reach = reader.section("contour").get("reach", reach, between(1e-3, 1e6));
}

void read_surface(const ConfigReader& reader, SurfaceOptions& surface) {
  read_image_term(reader, "keypoints", surface.keypoint_weight, surface.keypoint_scale);
  read_image_term(reader, "silhouette", surface.silhouette_weight, surface.silhouette_scale);
  read_contour(reader, surface.contour_weight, surface.contour_reach);
  read_weight(reader, "arap", surface.arap_weight);
  read_weight(reader, "temporal", surface.temporal_weight);
  read_weight(reader, "rest", surface.rest_weight);
  surface.outline_vertices = reader.get("vertices", surface.outline_vertices, between(1, 1000000));
  surface.rounds = reader.get("rounds", surface.rounds, between(0, 100));
  read_solver(reader.section("solver"), surface.solver);
}

}  // namespace

TrackConfig read_track_config(const ConfigDocument& document, TrackConfig config) {
  MultiviewOptions& fit = config.fit;
  const ConfigReader root = document.root();
  root.renamed("usual", "shared_dofs");
  root.renamed("template", "template_fit");
  read_pose_fit(root, fit);
  const ConfigReader silhouette = root.section("silhouette");
  fit.silhouette_inside = silhouette.get("inside", fit.silhouette_inside, between(0.0, 1.0));
  fit.outline_rounds = silhouette.get("rounds", fit.outline_rounds, between(0, 100));
  read_contour(root, fit.contour_weight, fit.contour_reach);
  fit.max_landmark_distance = inlier_section(root).get("max_distance", fit.max_landmark_distance, between(1e-3, 1e3));
  read_surface(root.section("surface"), config.surface);
  config.surface.outline_pixels = fit.outline_pixels;
  config.template_frames = root.section("template_fit").get("frames", config.template_frames, between(0, 100000));
  config.dofs = DofChoice::read(root);
  const ConfigReader shared = root.section("shared_dofs");
  config.shared_dofs = shared.list<std::string>("dofs");
  config.shared_frames = shared.get("frames", config.shared_frames, between(1, 100000));
  fit.shared_dofs.weight = shared.get("weight", fit.shared_dofs.weight, between(0.0, 1e12));
  config.smoothing = root.get("smoothing", config.smoothing, between(0.0, 1000.0));
  root.finish();
  return config;
}

}  // namespace doppel
