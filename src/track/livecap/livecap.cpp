#include "doppel/track/livecap/livecap.h"

#include <cmath>
#include <limits>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/clock.h"
#include "doppel/core/error.h"
#include "doppel/core/thin_out.h"
#include "doppel/track/energy/alignment.h"
#include "doppel/track/energy/fit_problem.h"
#include "doppel/track/energy/inliers.h"
#include "doppel/track/energy/outline.h"
#include "doppel/track/energy/terms/floor_term.h"
#include "doppel/track/energy/terms/gaussian_term.h"
#include "doppel/track/energy/terms/keypoint_term.h"
#include "doppel/track/energy/terms/level_term.h"
#include "doppel/track/energy/terms/limit_term.h"
#include "doppel/track/energy/terms/point_term.h"
#include "doppel/track/energy/terms/prior_term.h"
#include "doppel/track/energy/terms/relative_point_term.h"
#include "doppel/track/energy/terms/silhouette_term.h"
#include "doppel/track/livecap/single_view_start.h"

namespace doppel {
namespace {

using Points = std::vector<std::optional<Eigen::Vector3d>>;
using Terms = std::vector<std::unique_ptr<PoseTerm>>;

constexpr std::size_t kMinLandmarks = 4;

void check(const LivecapOptions& options) {
  check_fit(options);
  check_not_negative("joint weight", options.joint_weight);
  check_not_negative("smallest confidence of a keypoint", options.min_confidence);
  if (options.keypoint_weight == 0.0 && options.joint_weight == 0.0)
    fail("the keypoint weight and the joint weight of the fit are both 0; without either, nothing can be tracked");
}

std::vector<Eigen::Vector3d> landmarks_of(const PoseModel& model, const PosedBody& body) {
  std::vector<Eigen::Vector3d> points;
  points.reserve(model.num_landmarks());
  for (int m = 0; m < model.num_landmarks(); ++m) points.push_back(model.landmark(body, m));
  return points;
}

/// [M] The heights of landmarks above the lowest vertex of the rest pose.
std::vector<double> heights_at_rest(const PoseModel& model) {
  const Character& character = model.character();
  double lowest = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& vertex : character.mesh.vertices) lowest = std::min(lowest, vertex.y());
  std::vector<double> heights;
  for (const Eigen::Vector3d& landmark : landmarks_of(model, model.pose(character.rest_dofs, false)))
    heights.push_back(landmark.y() - lowest);
  return heights;
}

}  // namespace

LivecapOptions::LivecapOptions() {
  keypoint_weight = per_squared_thesis_pixel(460.0);  // lambda_2D
  keypoint_scale = thesis_pixels(20.0);
  silhouette_weight = per_squared_thesis_pixel(60.0);
  silhouette_scale = thesis_pixels(20.0);
  limit_weight = 1e6;
  temporal_weight = 0.0;  // the filter of the motion replaces both
  steady_weight = 0.0;
  prior_weight = 20000.0;
  outline_vertices = 300;
  solver.iterations = 6;
  solver.initial_damping = 1e-6;
  inlier_threshold = thesis_pixels(21.0);
}

/// The input of the terms of one frame.
struct LivecapTracker::Evidence {
  FrameEvidence frame;                ///< [1]
  Points joints;                      ///< [M] world axes, with the body's bone lengths
  std::vector<double> joint_weights;  ///< [M] relative to `LivecapOptions::joint_weight`
};

struct LivecapTracker::Fit {
  TrackedFrame frame;
  double cost = std::numeric_limits<double>::infinity();  ///< of all terms
  Eigen::MatrixXd hessian;                                ///< [n,n] of half the cost, lower half
};

LivecapTracker::LivecapTracker(const Character& character, const std::vector<Marker>& landmarks,
                               const std::vector<int>& dofs, const PinholeCamera& camera, const LivecapOptions& options)
    : model_(character, landmarks, dofs),
      cameras_{camera},
      options_(options),
      viewer_(character, camera, options.outline_pixels),
      roles_(landmark_roles(landmarks)),
      tree_(character.skeleton, landmarks, character.rest_dofs),
      rigidity_(rigidity_of_landmarks(model_)),
      sole_height_(heights_at_rest(model_)),
      usual_(options.usual_poses.empty() || options.usual_weight == 0.0
                 ? std::nullopt
                 : std::optional(learn_pose_prior(model_, options.usual_poses, options.usual_spread))),
      usual_pose_(usual_ ? usual_->mean : character.rest_dofs),
      history_(usual_pose_),
      motion_(options.motion),
      rest_vertices_(character.mesh.vertices),
      surface_(character, cameras_.front(), options.nonrigid) {
  check(options);
  if (landmarks.size() < kMinLandmarks)
    fail("tracking from one camera needs at least {} landmarks on the skeleton, received {}", kMinLandmarks,
         landmarks.size());
  if (!model_.root())
    fail(
        "tracking from one camera needs a root that translates and rotates freely; all of its six DoFs must be "
        "unknown");
  for (std::size_t m = 0; !options.faces && m < landmarks.size(); ++m)
    if (roles_.detection[m] < 1.0) roles_.detection[m] = 0.0;
}

void LivecapTracker::cut() {
  pause();
  history_.cut();
}

void LivecapTracker::pause() {
  history_.clear();
  motion_.clear();
  forget_surface();
}

void LivecapTracker::forget_surface() {
  surface_.cut();
  deform_template(model_.character().mesh.vertices);
}

void LivecapTracker::deform_template(std::vector<Eigen::Vector3d> rest_vertices) {
  rest_vertices_ = std::move(rest_vertices);
  model_.set_rest_vertices(rest_vertices_);
}

FrameResult LivecapTracker::track(const LivecapInput& input) {
  const auto start = Clock::now();
  Evidence evidence{{input.view}, {}, {}};
  for (const JointDetection& joint : input.joints) {
    evidence.joints.push_back(
        joint.seen ? std::optional<Eigen::Vector3d>(cameras_.front().R.transpose() * joint.position) : std::nullopt);
    evidence.joint_weights.push_back(std::pow(kJointNoise / joint.noise, 2));
  }
  if (options_.joint_weight == 0.0) evidence.joints.clear();
  if (!evidence.joints.empty())
    evidence.joints =
        tree_.with_lengths_of(std::move(evidence.joints), landmarks_of(model_, model_.pose(history_.last(), false)));
  evidence.joints.resize(model_.num_landmarks());
  FrameResult frame;
  Fit found = track_pose(evidence);
  remember(found);
  frame.pose = std::move(found.frame);
  frame.pose_seconds = seconds_since(start);
  track_surface(input, frame);
  frame.surface_seconds = seconds_since(start) - frame.pose_seconds;
  return frame;
}

LivecapTracker::Fit LivecapTracker::track_pose(const Evidence& evidence) {
  Fit best;
  best.frame.dofs = history_.last();
  const Inliers inliers =
      count_inliers(model_, model_.pose(best.frame.dofs, false), cameras_, evidence.frame, options_.inlier_threshold);
  best.frame.keypoints = inliers.keypoints;
  if (inliers.keypoints < options_.min_keypoints) return best;
  if (!history_.empty()) {
    const std::vector<double> expected = predicted_pose();
    best = fit(evidence, expected, &expected);
  }
  if (best.frame.found()) return best;
  Fit anew = start_anew(evidence);
  anew.frame.iterations += best.frame.iterations;
  if (!anew.frame.found()) {
    best.frame.dofs = history_.last();
    return best;
  }
  anew.frame.state = history_.state_of_restart();
  return anew;
}

std::vector<double> LivecapTracker::predicted_pose() const {
  return motion_.empty() ? history_.predicted(model_.root()) : motion_.predicted(model_).dofs;
}

void LivecapTracker::remember(const Fit& found) {
  const bool follows = found.frame.state == FrameState::tracked;
  if (!follows) forget_surface();
  history_.remember(found.frame);
  if (!found.frame.found() || options_.motion.turn_weight == 0.0)
    motion_.clear();
  else if (follows && !motion_.empty())
    motion_.add(model_, found.frame.dofs, found.hessian);
  else
    motion_.start(model_, found.frame.dofs, found.hessian);
}

std::unique_ptr<PoseTerm> LivecapTracker::floor_term(bool follows) const {
  const std::vector<Eigen::Vector3d> last = landmarks_of(model_, model_.pose(history_.last(), false));
  std::vector<FloorTerm::Sole> soles;
  for (const int m : roles_.soles) soles.push_back({m, sole_height_[m], last[m]});
  return std::make_unique<FloorTerm>(std::move(soles), options_.floor_weight, follows ? options_.floor_slide : 0.0,
                                     RobustKernel::geman_mcclure_of(options_.floor_scale));
}

Terms LivecapTracker::terms(const Evidence& evidence, const std::vector<double>* expected,
                            double keypoint_weight) const {
  Terms result;
  const LivecapOptions& o = options_;
  if (keypoint_weight > 0.0)
    result.push_back(std::make_unique<KeypointTerm<PoseModel>>(
        cameras_, evidence.frame, keypoint_weight, RobustKernel::geman_mcclure_of(o.keypoint_scale), roles_.detection,
        KeypointConfidence{!o.ignore_confidence, o.min_confidence}));
  std::vector<PointTerm::Target> joints;
  for (std::size_t m = 0; m < evidence.joints.size(); ++m)
    if (evidence.joints[m]) joints.push_back({static_cast<int>(m), *evidence.joints[m], evidence.joint_weights[m]});
  if (!joints.empty())
    result.push_back(std::make_unique<RelativePointTerm>("joints", std::move(joints), o.joint_weight));
  if (o.limit_weight > 0.0) result.push_back(std::make_unique<LimitTerm>(o.limit_weight));
  if (o.prior_weight > 0.0) result.push_back(std::make_unique<PriorTerm>("prior", usual_pose_, o.prior_weight));
  if (usual_)
    result.push_back(std::make_unique<GaussianTerm>("usual", usual_->mean, usual_->covariance / o.usual_weight));
  if (o.floor_weight > 0.0 && !roles_.soles.empty()) result.push_back(floor_term(expected != nullptr));
  if (!expected) return result;
  if (!motion_.empty()) {
    MotionFilter::Prediction next = motion_.predicted(model_);
    result.push_back(std::make_unique<GaussianTerm>("motion", std::move(next.dofs), next.covariance));
  }
  if (o.steady_weight > 0.0) result.push_back(std::make_unique<PriorTerm>("steady", *expected, o.steady_weight));
  if (o.temporal_weight == 0.0) return result;
  const std::vector<Eigen::Vector3d> last = landmarks_of(model_, model_.pose(history_.last(), false));
  std::vector<PointTerm::Target> targets;
  for (std::size_t m = 0; m < last.size(); ++m) targets.push_back({static_cast<int>(m), last[m], roles_.steadiness[m]});
  result.push_back(std::make_unique<PointTerm>("temporal", std::move(targets), o.temporal_weight));
  return result;
}

/// Removes depth from the displacements before the pose is fitted. Displacements that enlarge the whole outline look
/// like a motion towards the camera. With them, depth could drift between pose and displacements from frame to frame.
/// The translation along the camera's ray that best explains the change of the outline is therefore subtracted.
void LivecapTracker::set_depth_aside(const PosedSurface& surface, const std::vector<OutlineVertex>& outline) {
  const PinholeCamera& camera = cameras_.front();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const OutlineVertex& vertex : outline) middle += surface.vertices.col(vertex.vertex);
  const Eigen::Vector3d ray = (middle / static_cast<double>(outline.size()) - camera.centre()).normalized();
  double both = 0.0, own = 0.0;
  for (const OutlineVertex& vertex : outline) {
    const auto v = as_size(vertex.vertex);
    const auto projected = project_with_jacobian(camera, surface.vertices.col(vertex.vertex));
    if (!projected) continue;
    const Eigen::RowVector3d across =
        (projected->jacobian * surface.normals[v]).normalized().transpose() * projected->jacobian;
    const double displaced = across * surface.turns[v] * (rest_vertices_[v] - model_.character().mesh.vertices[v]);
    both += across.dot(ray) * displaced;
    own += across.dot(ray) * across.dot(ray);
  }
  if (!(own > 0.0)) return;
  std::vector<Eigen::Vector3d> rest = rest_vertices_;
  for (std::size_t v = 0; v < rest.size(); ++v) rest[v] -= both / own * (surface.turns[v].transpose() * ray);
  model_.set_rest_vertices(std::move(rest));
}

/// The silhouette term of the surface with the displacements of the last frame, in a pose.
std::unique_ptr<PoseTerm> LivecapTracker::silhouette_term(const Evidence& evidence, const std::vector<double>& dofs) {
  const PosedSurface surface = pose_surface(model_, model_.pose(dofs, false), rest_vertices_);
  std::vector<OutlineVertex> outline = viewer_.look(surface, evidence.frame.front().outline.box(), 0.0).outline;
  if (options_.remove_depth) set_depth_aside(surface, outline);
  if (!options_.own_distance) drop_own_distances(outline);
  thin_out(outline, options_.outline_vertices);
  // The thesis's weight is that of one vertex; the vertices of the term share its weight.
  const double weight = options_.silhouette_weight * static_cast<double>(outline.size());
  auto term = std::make_unique<SilhouetteTerm<PoseModel>>(cameras_, evidence.frame, std::move(outline), weight, 1.0,
                                                          RobustKernel::geman_mcclure_of(options_.silhouette_scale));
  if (!options_.level_silhouette) return term;
  return std::make_unique<LevelTerm>(std::move(term));
}

/// @param expected the predicted pose, or null
LivecapTracker::Fit LivecapTracker::fit(const Evidence& evidence, std::vector<double> start,
                                        const std::vector<double>* expected) {
  Terms all = terms(evidence, expected, options_.keypoint_weight);
  if (options_.silhouette_weight > 0.0 && !evidence.frame.front().outline.empty())
    all.push_back(silhouette_term(evidence, start));
  FitProblem<PoseModel> problem(model_, std::move(all));
  Eigen::VectorXd state = problem.to_eigen(start);
  const SolverSummary summary = minimise(problem, state, options_.solver);
  start = problem.to_vector(state);
  Fit result;
  result.hessian = problem.system().hessian();
  result.frame.iterations = summary.iterations;
  result.frame.terms = summary.terms;
  result.frame.reason = summary.reason;
  result.cost = summary.final_cost;
  const Inliers inliers =
      count_inliers(model_, model_.pose(start, false), cameras_, evidence.frame, options_.inlier_threshold);
  result.frame.dofs = std::move(start);
  result.frame.keypoints = inliers.keypoints;
  result.frame.inlier_ratio = inliers.ratio;
  result.frame.keypoint_error = inliers.error;
  const bool good = inliers.keypoints >= options_.min_keypoints && inliers.ratio >= options_.min_inlier_ratio &&
                    std::isfinite(summary.final_cost);
  result.frame.state = good ? FrameState::tracked : FrameState::lost;
  return result;
}

/// Fits from several initial poses, the last found pose among them, and takes the result of lowest cost. It must have
/// `min_keypoints` inliers: with fewer, outliers could decide the pose. Keypoints are used even where their weight is
/// 0, because far from the outline nothing else determines the position of the body.
LivecapTracker::Fit LivecapTracker::start_anew(const Evidence& evidence) {
  Fit best;
  best.frame.dofs = history_.last();
  int steps = 0;
  SolverOptions solver = options_.solver;
  solver.iterations = options_.start_iterations;
  const double led = options_.keypoint_weight > 0.0 ? options_.keypoint_weight : LivecapOptions().keypoint_weight;
  auto starts = single_view_starts(model_, cameras_.front(), evidence.frame.front().keypoints, evidence.joints,
                                   rigidity_, usual_pose_);
  if (!history_.segment_begins()) starts.push_back(history_.last());
  for (std::vector<double>& start : starts) {
    steps += doppel::fit(model_, terms(evidence, nullptr, led), start, solver).iterations;
    Fit found = fit(evidence, std::move(start), nullptr);
    steps += found.frame.iterations;
    if (found.cost < best.cost) best = std::move(found);
  }
  best.frame.iterations = steps;
  const auto agreeing = std::lround(best.frame.inlier_ratio * best.frame.keypoints);
  if (agreeing < options_.min_keypoints) best.frame.state = FrameState::lost;
  return best;
}

void LivecapTracker::track_surface(const LivecapInput& input, FrameResult& frame) {
  const PosedSurface posed =
      pose_surface(model_, model_.pose(frame.pose.dofs, false), model_.character().mesh.vertices);
  frame.vertices = posed.vertices;
  if (!options_.surface || !frame.pose.found() || input.view.outline.empty()) return;
  NonrigidSurface found = surface_.fit(posed, input.view.outline, input.image);
  frame.vertices = std::move(found.vertices);
  deform_template(surface_.rest_vertices());
}

}  // namespace doppel
