#include "doppel/track/refine/refine_frame.h"

#include "doppel/track/energy/inliers.h"
#include "doppel/track/energy/terms/limit_term.h"
#include "doppel/track/energy/terms/prior_term.h"
#include "doppel/track/multiview/multiview.h"

namespace doppel {
namespace {

double kernel_weight(double squared, double scale) { return RobustKernel::geman_mcclure_of(scale).weight(squared); }

}  // namespace

TrackedFrame judge_pose(const PoseModel& model, const std::vector<PinholeCamera>& cameras, const FrameEvidence& seen,
                        std::vector<double> dofs, const PoseFitOptions& options) {
  const Inliers inliers = count_inliers(model, model.pose(dofs, false), cameras, seen, options.inlier_threshold);
  const bool good = inliers.keypoints >= options.min_keypoints && inliers.ratio >= options.min_inlier_ratio;
  TrackedFrame found;
  found.state = good ? FrameState::tracked : FrameState::lost;
  found.dofs = std::move(dofs);
  found.keypoints = inliers.keypoints;
  found.inlier_ratio = inliers.ratio;
  found.keypoint_error = inliers.error;
  return found;
}

FrameRefiner::FrameRefiner(const Character& character, const std::vector<Marker>& landmarks,
                           const std::vector<PinholeCamera>& cameras, const TrackConfig& config,
                           const RefineWeights& weights)
    : cameras_(cameras),
      config_(config),
      weights_(weights),
      model_(character, landmarks, chosen_dofs(config.dofs, character.skeleton, landmarks)),
      outlines_(character, cameras, config.fit.outline_vertices),
      drawer_(character.mesh),
      finder_(weights.flow_width) {}

FrameFlow FrameRefiner::flow(const FootageFrame& seen, const std::vector<double>& dofs) {
  FrameFlow result;
  result.vertices = posed_vertices(model_, model_.pose(dofs, false));
  const std::vector<Eigen::Vector3d>& vertices = result.vertices;
  result.views.resize(cameras_.size());
  double sum = 0.0, weight = 0.0;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    if (seen.images[c].empty()) continue;
    const DrawnSurface drawn = drawer_.draw(vertices, cameras_[c]);
    result.views[c] = finder_.find(drawn, seen.images[c], seen.masks[c]);
    for (const SurfaceMatch& match : surface_matches(result.views[c], drawn, vertices, cameras_[c], static_cast<int>(c),
                                                     weights_.matches_per_camera)) {
      const double sureness = match.sureness.trace() / 2.0;
      sum +=
          sureness * reference_pixels(cameras_[c]) * (match.pixel - cameras_[c].project(vertices[match.vertex])).norm();
      weight += sureness;
      result.matches.push_back(match);
    }
  }
  if (weight > 0.0) result.distance = sum / weight;
  return result;
}

TrackedFrame FrameRefiner::fit(const FootageFrame& seen, const std::vector<SurfaceMatch>& matches,
                               const std::vector<double>& start) const {
  const MultiviewOptions& options = config_.fit;
  const auto outline = outlines_.find(seen.evidence, posed_vertices(model_, model_.pose(start, false)));
  auto terms = image_terms<PoseModel>(cameras_, seen.evidence, outline, options);
  terms.push_back(
      std::make_unique<MatchTerm>(cameras_, matches, weights_.matches, RobustKernel::geman_mcclure_of(weights_.scale)));
  if (options.limit_weight > 0.0) terms.push_back(std::make_unique<LimitTerm>(options.limit_weight));
  if (options.steady_weight > 0.0) terms.push_back(std::make_unique<PriorTerm>("steady", start, options.steady_weight));
  std::vector<double> dofs = start;
  const SolverSummary summary = doppel::fit<PoseModel>(model_, std::move(terms), dofs, options.solver);
  TrackedFrame found = judge(seen, dofs);
  found.iterations = summary.iterations;
  found.terms = summary.terms;
  found.reason = summary.reason;
  return found;
}

TrackedFrame FrameRefiner::judge(const FootageFrame& seen, const std::vector<double>& dofs) const {
  return judge_pose(model_, cameras_, seen.evidence, dofs, config_.fit);
}

void FrameRefiner::add_to(SurfaceOffset& offset, const FootageFrame& seen, const std::vector<SurfaceMatch>& matches,
                          const std::vector<double>& dofs) const {
  const PosedBody body = model_.pose(dofs, false);
  const auto vertices = posed_vertices(model_, body);
  const double share = 1.0 / static_cast<double>(cameras_.size());
  for (const SurfaceMatch& match : matches) {
    const auto residual = match_residual(match, cameras_[match.camera], vertices[match.vertex]);
    if (!residual) continue;
    const Eigen::Matrix<double, 2, 3> gradient = residual->jacobian * model_.movement(body, match.vertex).linear();
    const double weight = share * kernel_weight(residual->value.squaredNorm(), weights_.scale);
    for (int k = 0; k < 2; ++k) offset.add(match.vertex, gradient.row(k).transpose(), residual->value[k], weight);
  }
  for (const OutlineVertex& outline : outlines_.find(seen.evidence, vertices)) {
    const OutlineField& field = seen.evidence[outline.camera].outline;
    const auto projected = project_with_jacobian(cameras_[outline.camera], vertices[outline.vertex]);
    if (field.empty() || !projected) continue;
    const OutlineField::Sample sample = field.at(projected->pixel);
    if (belongs_to_opposite_outline(*projected, model_.normal(body, outline.vertex), sample)) continue;
    const double scale = reference_pixels(cameras_[outline.camera]);
    const double error = scale * sample.distance - outline.distance;
    const Eigen::Vector3d gradient =
        scale * (projected->jacobian * model_.movement(body, outline.vertex).linear()).transpose() * sample.gradient;
    const double weight = share * kernel_weight(error * error, config_.fit.silhouette_scale);
    offset.add(outline.vertex, gradient, error, weight);
  }
}

double FrameRefiner::overlap(const FootageFrame& seen, const std::vector<double>& dofs) const {
  return outlines_.overlap(seen.evidence, posed_vertices(model_, model_.pose(dofs, false)));
}

}  // namespace doppel
