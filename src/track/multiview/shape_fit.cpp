#include "doppel/track/multiview/shape_fit.h"

#include <cmath>
#include <random>

#include "doppel/core/error.h"
#include "doppel/core/statistics.h"
#include "doppel/track/energy/terms/distance_term.h"
#include "doppel/track/energy/terms/shape_prior_term.h"
#include "doppel/track/multiview/shared_problem.h"

namespace doppel {
namespace {

constexpr int kPoses = 24;         // over which the distances of pairs are compared
constexpr double kMaxBend = 1.2;   // radians from the rest pose, for DoFs without limits
constexpr double kSteady = 0.15;   // largest deviation over poses of the distance of a pair that counts, as a share
constexpr double kMinPair = 0.08;  // metres; the error of landmarks is too large for shorter pairs
constexpr double kDistanceWeight = 1e5;  // per squared metre, beside 1 per squared deviation of a parameter

/// Poses spread over the ranges of the DoFs.
std::vector<std::vector<double>> various_poses(const Character& character) {
  std::mt19937_64 random(1);
  std::vector<std::vector<double>> poses;
  for (int i = 0; i < kPoses; ++i) {
    std::vector<double> dofs = character.rest_dofs;
    for (std::size_t d = 0; d < dofs.size(); ++d) {
      const auto limits = character.skeleton.dofs[d].limits;
      const double low = limits ? (*limits)[0] : dofs[d] - kMaxBend, high = limits ? (*limits)[1] : dofs[d] + kMaxBend;
      const double share = static_cast<double>(random()) / static_cast<double>(std::mt19937_64::max());
      dofs[d] = low + share * (high - low);
    }
    poses.push_back(std::move(dofs));
  }
  return poses;
}

/// The median distance of a pair over all frames; nothing when no frame has both.
std::optional<double> median_distance(const std::array<int, 2>& pair, const std::vector<SpaceLandmarks>& frames) {
  std::vector<double> distances;
  for (const SpaceLandmarks& frame : frames) {
    const auto &a = frame[pair[0]], &b = frame[pair[1]];
    if (a && b) distances.push_back((*a - *b).norm());
  }
  if (distances.empty()) return std::nullopt;
  return median(std::move(distances));
}

}  // namespace

std::vector<SteadyPair> steady_pairs(const Character& character, const std::vector<std::string>& landmarks,
                                     double tolerance) {
  const ShapedBody body(character, landmarks);
  const int count = static_cast<int>(landmarks.size());
  std::vector<PosedBody> posed{body.poses().pose(character.rest_dofs, false)};
  for (const std::vector<double>& dofs : various_poses(character)) posed.push_back(body.poses().pose(dofs, false));
  std::vector<SteadyPair> pairs;
  for (int a = 0; a < count; ++a)
    for (int b = a + 1; b < count; ++b) {
      const auto distance = [&](const PosedBody& pose) {
        return (body.poses().landmark(pose, a) - body.poses().landmark(pose, b)).norm();
      };
      const double rest = distance(posed.front());
      double squares = 0.0;
      for (const PosedBody& pose : posed) squares += std::pow(distance(pose) - rest, 2);
      const double deviation = std::sqrt(squares / static_cast<double>(posed.size()));
      if (rest >= kMinPair && deviation <= tolerance * rest) pairs.push_back({{a, b}, deviation});
    }
  return pairs;
}

std::vector<double> shape_from_landmarks(const ShapeFamily& family, const std::vector<std::string>& landmarks,
                                         const std::vector<SpaceLandmarks>& frames) {
  std::vector<double> shape = family.mean();
  const Character usual = family.character(shape);
  std::vector<DistanceTerm::Pair> pairs;
  for (const SteadyPair& pair : steady_pairs(usual, landmarks, kSteady))
    if (const auto distance = median_distance(pair.landmarks, frames))
      pairs.push_back({pair.landmarks, *distance, 1.0 / (1.0 + kDistanceWeight * pair.deviation * pair.deviation)});
  const ShapeSource source(family, landmarks);
  const ShapeModel model(source, usual.rest_dofs);
  FitProblem<ShapeModel>::Terms terms;
  terms.push_back(std::make_unique<DistanceTerm>(std::move(pairs), kDistanceWeight));
  terms.push_back(std::make_unique<ShapePriorTerm>(1.0));
  fit(model, std::move(terms), shape);
  return shape;
}

std::vector<double> fit_shape(const ShapeFamily& family, const std::vector<std::string>& landmarks,
                              const std::vector<PinholeCamera>& cameras, const std::vector<PosedEvidence>& frames,
                              const std::vector<double>& start, const ShapeFitOptions& options) {
  if (frames.empty()) fail("there is no frame to fit the shape to");
  const MultiviewOptions& images = options.images;
  const ShapeSource source(family, landmarks);
  const OutlineFinder outlines(family.character(start), cameras, images.outline_vertices);
  std::vector<ShapeModel> models;
  for (const PosedEvidence& frame : frames) models.emplace_back(source, frame.dofs);
  std::vector<double> shape = start;
  for (int round = 0; round < options.rounds; ++round) {
    SharedProblem<ShapeModel> problem;
    for (std::size_t f = 0; f < frames.size(); ++f) {
      const PosedShape posed = models[f].pose(shape, false);
      const auto outline = outlines.find(frames[f].seen, posed_vertices(posed.poses(), posed.body));
      problem.add(models[f], image_terms<ShapeModel>(cameras, frames[f].seen, outline, images));
    }
    FitProblem<ShapeModel>::Terms prior;
    prior.push_back(std::make_unique<ShapePriorTerm>(options.prior_weight * static_cast<double>(frames.size())));
    problem.add(models.front(), std::move(prior));
    Eigen::VectorXd state = FitProblem<ShapeModel>::to_eigen(shape);
    minimise(problem, state, images.solver);
    shape = FitProblem<ShapeModel>::to_vector(state);
  }
  return shape;
}

}  // namespace doppel
