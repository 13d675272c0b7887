#include "doppel/track/track_config.h"

#include <algorithm>

#include "doppel/core/error.h"

namespace doppel {
namespace {

void read_weight(const ConfigReader& root, const char* term, double& weight) {
  weight = root.section(term).get("weight", weight, between(0.0, 1e12));
}

void read_image_term(const ConfigReader& root, const char* term, double& weight, double& scale) {
  read_weight(root, term, weight);
  scale = root.section(term).get("scale", scale, between(1e-3, 1e6));
}

void read_solver(const ConfigReader& reader, SolverOptions& solver) {
  solver.iterations = reader.get("iterations", solver.iterations, between(1, 10000));
  solver.initial_damping = reader.get("damping", solver.initial_damping, between(0.0, 1e6));
  solver.smallest_gain = reader.get("smallest_gain", solver.smallest_gain, between(0.0, 1.0));
}

}  // namespace

TrackConfig read_track_config(const ConfigDocument& document) {
  TrackConfig config;
  MultiviewOptions& fit = config.fit;
  const ConfigReader root = document.root();
  read_image_term(root, "keypoints", fit.keypoint_weight, fit.keypoint_scale);
  read_image_term(root, "silhouette", fit.silhouette_weight, fit.silhouette_scale);
  const ConfigReader silhouette = root.section("silhouette");
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
  config.dofs = root.list<std::string>("dofs");
  config.smoothing = root.get("smoothing", config.smoothing, between(0.0, 1000.0));
  root.finish();
  return config;
}

std::vector<int> chosen_dofs(const TrackConfig& config, const Skeleton& skeleton,
                             const std::vector<Marker>& landmarks) {
  if (config.dofs.empty()) return observable_dofs(skeleton, landmarks);
  std::vector<std::string> known;
  for (const Dof& dof : skeleton.dofs) known.push_back(dof.name);
  std::vector<int> dofs;
  for (const std::string& name : config.dofs) {
    const std::optional<int> dof = skeleton.find_dof(name);
    if (!dof)
      fail<UsageError>("`dofs` names '{}', which the skeleton does not have; the nearest is '{}'", name,
                       nearest_word(name, known).value_or(known.empty() ? "" : known.front()));
    if (std::find(dofs.begin(), dofs.end(), *dof) == dofs.end()) dofs.push_back(*dof);
  }
  return dofs;
}

}  // namespace doppel
