#include "doppel/track/multiview/multiview.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/core/error.h"
#include "doppel/track/energy/alignment.h"
#include "doppel/track/energy/inliers.h"
#include "doppel/track/energy/terms/contour_term.h"
#include "doppel/track/energy/terms/keypoint_term.h"
#include "doppel/track/energy/terms/limit_term.h"
#include "doppel/track/energy/terms/point_term.h"
#include "doppel/track/energy/terms/prior_term.h"
#include "doppel/track/energy/terms/silhouette_term.h"

namespace doppel {
namespace {

// The fit to triangulated points. Points about 15 cm away still have influence; triangulation outliers have little.
constexpr double kPointScale = 0.15;    // metres
constexpr double kPointWeight = 1.0e5;  // per squared metre: three cameras at 2 mm per pixel
constexpr int kStartIterations = 60;    // enough from the rest pose to any other
constexpr int kMinTriangulated = 4;     // triangulated landmarks that a start needs

using Terms = std::vector<std::unique_ptr<PoseTerm>>;

double cost_of(const std::vector<TermCost>& terms, const std::string& name) {
  for (const TermCost& term : terms)
    if (term.name == name) return term.cost;
  return 0.0;
}

void check(const MultiviewOptions& options) {
  check_fit(options);
  check_not_negative("farthest landmark", options.max_landmark_distance);
  if (options.keypoint_weight == 0.0)
    fail("the keypoint weight of the fit is 0; without keypoints nothing can be tracked");
  if (options.outline_rounds < 0)
    fail("the number of outline rounds of the fit is {}; it must be 0 or more", options.outline_rounds);
}

/// The weight of the prior on each DoF, [D], per squared radian: for shared DoFs the larger of both weights. Empty when
/// all weights are 0.
std::vector<double> prior_weights(const MultiviewOptions& options, std::size_t num_dofs) {
  std::vector<double> weights(num_dofs, options.prior_weight);
  for (const int dof : options.shared_dofs.dofs) {
    double& weight = weights[dof];
    weight = std::max(weight, options.shared_dofs.weight);
  }
  const bool held = std::any_of(weights.begin(), weights.end(), [](double weight) { return weight > 0.0; });
  return held ? weights : std::vector<double>();
}

}  // namespace

void SharedDofs::put_into(std::vector<double>& pose) const {
  for (std::size_t i = 0; i < dofs.size(); ++i) pose[dofs[i]] = values[i];
}

/// A fit from one start.
struct MultiviewTracker::Fit {
  TrackedFrame frame;
  double keypoint_cost = std::numeric_limits<double>::infinity();
};

MultiviewTracker::MultiviewTracker(const Character& character, const std::vector<Marker>& landmarks,
                                   const std::vector<int>& dofs, std::vector<PinholeCamera> cameras,
                                   const MultiviewOptions& options)
    : model_(character, landmarks, dofs),
      cameras_(std::move(cameras)),
      options_(options),
      outlines_(character, cameras_, options.outline_vertices),
      rigidity_(rigidity_of_landmarks(model_)),
      shared_(character.rest_dofs),
      history_(shared_) {
  check(options);
  options_.shared_dofs.put_into(shared_);
  history_ = PoseHistory(shared_);
  if (cameras_.size() < 2)
    fail<UsageError>(
        "the multi-view fit triangulates landmarks from several cameras; it needs at least 2 "
        "cameras, received {}",
        cameras_.size());
  if (model_.num_landmarks() < kMinTriangulated)
    fail("the multi-view fit needs at least {} landmarks on the skeleton, received {}", kMinTriangulated,
         model_.num_landmarks());
}

TrackedFrame MultiviewTracker::track(const FrameEvidence& frame) {
  const Points points = triangulate_all(cameras_, frame, model_.num_landmarks());
  Fit best;
  best.frame.dofs = history_.last();
  judge(frame, best.frame);
  const bool follows = !history_.empty(), visible = best.frame.keypoints >= options_.min_keypoints;
  if (visible && follows) {
    const std::vector<double> expected = history_.predicted(model_.root());
    best = fit(frame, expected, &expected);
    if (best.frame.found()) best.frame.state = FrameState::tracked;
  }
  if (visible && (!best.frame.found() || strays(best.frame, points))) {
    if (const auto start = start_anew(points)) {
      Fit anew = fit(frame, *start, nullptr);
      anew.frame.iterations += best.frame.iterations;
      if (anew.frame.found() && !(anew.keypoint_cost >= best.keypoint_cost)) {
        best = std::move(anew);
        best.frame.state = history_.state_of_restart();
      }
    }
  }
  history_.remember(best.frame);
  return best.frame;
}

/// A pose from triangulated landmarks alone: the root first, then all DoFs. It tries the rest pose and the last found
/// pose as starts and takes the result of lower cost.
std::optional<std::vector<double>> MultiviewTracker::start_anew(const Points& points) const {
  std::vector<PointTerm::Target> targets;
  for (std::size_t m = 0; m < points.size(); ++m)
    if (points[m])
      targets.push_back({static_cast<int>(m), points[m]->position, model_.landmark_weight(static_cast<int>(m))});
  if (targets.size() < kMinTriangulated) return std::nullopt;
  std::optional<std::vector<double>> best;
  double least = std::numeric_limits<double>::infinity();
  for (const std::vector<double>* from : {&shared_, &history_.last()}) {
    std::vector<double> dofs = align_root(model_, *from, points, rigidity_).value_or(*from);
    Terms terms;
    terms.push_back(std::make_unique<PointTerm>("points", targets, kPointWeight,
                                                RobustKernel{RobustKernel::Kind::geman_mcclure, kPointScale}));
    terms.push_back(std::make_unique<LimitTerm>(options_.limit_weight));
    terms.push_back(std::make_unique<PriorTerm>("prior", shared_, std::max(1.0, options_.prior_weight)));
    SolverOptions solver = options_.solver;
    solver.iterations = kStartIterations;
    const SolverSummary summary = doppel::fit<PoseModel>(model_, std::move(terms), dofs, solver);
    if (!(summary.final_cost < least)) continue;
    least = summary.final_cost;
    best = std::move(dofs);
  }
  return best;
}

template <typename Model>
typename FitProblem<Model>::Terms image_terms(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
                                              const std::vector<OutlineVertex>& outline, const MultiviewOptions& o) {
  const auto kernel = RobustKernel::geman_mcclure_of;
  typename FitProblem<Model>::Terms result;
  result.push_back(std::make_unique<KeypointTerm<Model>>(cameras, frame, o.keypoint_weight, kernel(o.keypoint_scale)));
  if (outline.empty()) return result;
  result.push_back(std::make_unique<SilhouetteTerm<Model>>(cameras, frame, outline, o.silhouette_weight,
                                                           o.silhouette_inside, kernel(o.silhouette_scale)));
  if (o.contour_weight > 0.0)
    result.push_back(std::make_unique<ContourTerm<Model>>(cameras, frame, outline, o.outline_vertices, o.contour_reach,
                                                          o.contour_weight, kernel(o.silhouette_scale)));
  return result;
}
template FitProblem<PoseModel>::Terms image_terms<PoseModel>(const std::vector<PinholeCamera>&, const FrameEvidence&,
                                                             const std::vector<OutlineVertex>&,
                                                             const MultiviewOptions&);
template FitProblem<ShapeModel>::Terms image_terms<ShapeModel>(const std::vector<PinholeCamera>&, const FrameEvidence&,
                                                               const std::vector<OutlineVertex>&,
                                                               const MultiviewOptions&);

Terms MultiviewTracker::terms(const FrameEvidence& frame, const std::vector<OutlineVertex>& outline,
                              const std::vector<double>* expected) const {
  Terms result = image_terms<PoseModel>(cameras_, frame, outline, options_);
  const MultiviewOptions& o = options_;
  if (o.limit_weight > 0.0) result.push_back(std::make_unique<LimitTerm>(o.limit_weight));
  if (const auto weights = prior_weights(o, shared_.size()); !weights.empty())
    result.push_back(std::make_unique<PriorTerm>("prior", shared_, weights));
  if (expected && o.steady_weight > 0.0)
    result.push_back(std::make_unique<PriorTerm>("steady", *expected, o.steady_weight));
  if (expected && o.temporal_weight > 0.0) {
    const PosedBody body = model_.pose(*expected, false);
    std::vector<PointTerm::Target> targets;
    targets.reserve(model_.num_landmarks());
    for (int m = 0; m < model_.num_landmarks(); ++m)
      targets.push_back({m, model_.landmark(body, m), model_.landmark_weight(m)});
    result.push_back(std::make_unique<PointTerm>("temporal", std::move(targets), o.temporal_weight));
  }
  return result;
}

/// Fits keypoints first, then keypoints and outlines. @param expected the predicted pose, or null
MultiviewTracker::Fit MultiviewTracker::fit(const FrameEvidence& frame, std::vector<double> start,
                                            const std::vector<double>* expected) const {
  Fit result;
  SolverSummary summary = doppel::fit<PoseModel>(model_, terms(frame, {}, expected), start, options_.solver);
  result.frame.iterations = summary.iterations;
  for (int round = 0; options_.silhouette_weight > 0.0 && round < options_.outline_rounds; ++round) {
    const auto outline = outlines_.find(frame, posed_vertices(model_, model_.pose(start, false)));
    summary = doppel::fit<PoseModel>(model_, terms(frame, outline, expected), start, options_.solver);
    result.frame.iterations += summary.iterations;
  }
  result.frame.dofs = std::move(start);
  result.frame.terms = summary.terms;
  result.frame.reason = summary.reason;
  result.keypoint_cost = cost_of(summary.terms, "keypoints");
  judge(frame, result.frame);
  const bool good = result.frame.keypoints >= options_.min_keypoints &&
                    result.frame.inlier_ratio >= options_.min_inlier_ratio && std::isfinite(summary.final_cost);
  result.frame.state = good ? FrameState::tracked : FrameState::lost;
  return result;
}

/// Counts the inliers of a pose.
void MultiviewTracker::judge(const FrameEvidence& frame, TrackedFrame& found) const {
  const Inliers inliers =
      count_inliers(model_, model_.pose(found.dofs, false), cameras_, frame, options_.inlier_threshold);
  found.keypoints = inliers.keypoints;
  found.inlier_ratio = inliers.ratio;
  found.keypoint_error = inliers.error;
}

/// Whether a landmark lies far from its position as triangulated from at least three views. Then a limb is wrong,
/// although most keypoints are inliers.
bool MultiviewTracker::strays(const TrackedFrame& found, const Points& points) const {
  const PosedBody body = model_.pose(found.dofs, false);
  for (std::size_t m = 0; m < points.size(); ++m)
    if (points[m] && points[m]->views >= 3 &&
        (model_.landmark(body, static_cast<int>(m)) - points[m]->position).norm() > options_.max_landmark_distance)
      return true;
  return false;
}

}  // namespace doppel
