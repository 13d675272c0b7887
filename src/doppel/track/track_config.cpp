#include "doppel/track/track_config.h"

#include <fnmatch.h>

#include <set>

#include "doppel/core/error.h"
#include "doppel/track/config_terms.h"

namespace doppel {
namespace {

void read_surface(const ConfigReader& reader, SurfaceOptions& surface) {
  read_image_term(reader, "keypoints", surface.keypoint_weight, surface.keypoint_scale);
  read_image_term(reader, "silhouette", surface.silhouette_weight, surface.silhouette_scale);
  read_weight(reader, "contour", surface.contour_weight);
  surface.contour_reach = reader.section("contour").get("reach", surface.contour_reach, between(1e-3, 1e6));
  read_weight(reader, "arap", surface.arap_weight);
  read_weight(reader, "temporal", surface.temporal_weight);
  read_weight(reader, "rest", surface.rest_weight);
  surface.outline_vertices = reader.get("vertices", surface.outline_vertices, between(1, 1000000));
  surface.rounds = reader.get("rounds", surface.rounds, between(0, 100));
  read_solver(reader.section("solver"), surface.solver);
}

}  // namespace

TrackConfig read_track_config(const ConfigDocument& document) {
  TrackConfig config;
  MultiviewOptions& fit = config.fit;
  const ConfigReader root = document.root();
  read_image_term(root, "keypoints", fit.keypoint_weight, fit.keypoint_scale);
  read_image_term(root, "silhouette", fit.silhouette_weight, fit.silhouette_scale);
  const ConfigReader silhouette = root.section("silhouette");
  fit.silhouette_inside = silhouette.get("inside", fit.silhouette_inside, between(0.0, 1.0));
  read_weight(root, "contour", fit.contour_weight);
  fit.contour_reach = root.section("contour").get("reach", fit.contour_reach, between(1e-3, 1e6));
  fit.outline_pixels = silhouette.get("pixels", fit.outline_pixels, between(16, 4096));
  fit.outline_vertices = silhouette.get("vertices", fit.outline_vertices, between(1, 1000000));
  fit.outline_rounds = silhouette.get("rounds", fit.outline_rounds, between(0, 100));
  read_weight(root, "limits", fit.limit_weight);
  read_weight(root, "temporal", fit.temporal_weight);
  read_weight(root, "steady", fit.steady_weight);
  read_weight(root, "prior", fit.prior_weight);
  read_solver(root.section("solver"), fit.solver);
  const ConfigReader trust = root.section("trust");
  fit.agreement = trust.get("pixels", fit.agreement, between(1e-3, 1e6));
  fit.smallest_share = trust.get("share", fit.smallest_share, between(0.0, 1.0));
  fit.fewest_keypoints = trust.get("keypoints", fit.fewest_keypoints, between(1, 1000000));
  fit.farthest_landmark = trust.get("distance", fit.farthest_landmark, between(1e-3, 1e3));
  read_surface(root.section("surface"), config.surface);
  config.surface.outline_pixels = fit.outline_pixels;
  config.worn_frames = root.section("template").get("frames", config.worn_frames, between(0, 100000));
  config.dofs = root.list<std::string>("dofs");
  config.also = root.list<std::string>("also");
  config.hold = root.list<std::string>("hold");
  config.smoothing = root.get("smoothing", config.smoothing, between(0.0, 1000.0));
  root.finish();
  return config;
}

namespace {

/// The DoFs whose names match one of the patterns.
std::set<int> named_dofs(const Skeleton& skeleton, const char* key, const std::vector<std::string>& patterns) {
  std::vector<std::string> known;
  for (const Dof& dof : skeleton.dofs) known.push_back(dof.name);
  std::set<int> dofs;
  for (const std::string& pattern : patterns) {
    bool found = false;
    for (int d = 0; d < skeleton.num_dofs(); ++d)
      if (fnmatch(pattern.c_str(), known[static_cast<std::size_t>(d)].c_str(), 0) == 0) {
        found = true;
        dofs.insert(d);
      }
    if (!found)
      fail<UsageError>("`{}` names '{}', which the skeleton does not have; the nearest is '{}'", key, pattern,
                       nearest_word(pattern, known).value_or(known.empty() ? "" : known.front()));
  }
  return dofs;
}

}  // namespace

std::vector<int> chosen_dofs(const TrackConfig& config, const Skeleton& skeleton,
                             const std::vector<Marker>& landmarks) {
  std::set<int> dofs = named_dofs(skeleton, "dofs", config.dofs);
  if (dofs.empty())
    for (const int dof : observable_dofs(skeleton, landmarks)) dofs.insert(dof);
  dofs.merge(named_dofs(skeleton, "also", config.also));
  for (const int dof : named_dofs(skeleton, "hold", config.hold)) dofs.erase(dof);
  return {dofs.begin(), dofs.end()};
}

}  // namespace doppel
