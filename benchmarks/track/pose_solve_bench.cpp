/// The pose of a frame seen by one camera (4.1-4.6): our solve against Ceres (if installed) with automatic derivatives
/// of one functor, on the same residuals and to the same cost. One thread. The synthetic actor, 33 unknowns; every
/// frame starts two frames behind.
///   pose_solve_bench [frames]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>

#include "doppel/character/observable_dofs.h"
#include "doppel/core/as_size.h"
#include "doppel/synth/actor.h"
#include "doppel/synth/performance.h"
#include "doppel/synth/studio.h"
#include "doppel/track/energy/fit_problem.h"
#include "doppel/track/energy/outline.h"
#include "doppel/track/energy/terms/keypoint_term.h"
#include "doppel/track/energy/terms/limit_term.h"
#include "doppel/track/energy/terms/prior_term.h"
#include "doppel/track/energy/terms/relative_point_term.h"
#include "doppel/track/livecap/landmark_roles.h"
#include "pose_frame.h"
#include "support/ratio.h"
#include "track/energy/body_fixture.h"

namespace doppel::bench {
namespace {

using Terms = std::vector<std::unique_ptr<PoseTerm>>;

/// The terms of `LivecapTracker`.
Terms terms_of(const PoseFrame& frame) {
  const LivecapOptions& o = frame.options;
  const auto kernel = [](double pixels) { return RobustKernel{RobustKernel::Kind::geman_mcclure, pixels}; };
  Terms terms;
  terms.push_back(std::make_unique<KeypointTerm<PoseModel>>(frame.cameras, frame.evidence, o.keypoint_weight,
                                                            kernel(o.keypoint_scale), frame.landmark_weights));
  terms.push_back(std::make_unique<RelativePointTerm>("joints", frame.joints, o.joint_weight));
  terms.push_back(std::make_unique<PointTerm>("temporal", frame.previous, o.temporal_weight));
  terms.push_back(std::make_unique<LimitTerm>(o.limit_weight));
  terms.push_back(std::make_unique<PriorTerm>("prior", frame.model->character().rest_dofs, o.prior_weight));
  terms.push_back(std::make_unique<PriorTerm>("steady", frame.expected, o.steady_weight));
  const double all = o.silhouette_weight * static_cast<double>(frame.outline.size());
  terms.push_back(std::make_unique<SilhouetteTerm<PoseModel>>(frame.cameras, frame.evidence, frame.outline, all, 1.0,
                                                              kernel(o.silhouette_scale)));
  return terms;
}

double cost_at(const PoseFrame& frame, const std::vector<double>& dofs) {
  FitProblem<PoseModel> problem(*frame.model, terms_of(frame));
  return problem.linearise(problem.to_eigen(dofs));
}

/// What a detector with 3 pixels and 20 mm of noise would say of a pose.
PoseFrame observe(const PoseModel& model, const PinholeCamera& camera, const std::vector<double>& ground_truth,
                  const std::vector<double>& before, std::mt19937& random) {
  std::normal_distribution<double> normal;
  PoseFrame frame{&model, {camera}, keypoints_of(model, {camera}, ground_truth), {}, {}, {}, {}, before, before, {}};
  const PosedBody now = model.pose(ground_truth, false), then = model.pose(before, false);
  const LandmarkRoles roles = landmark_roles(model.landmarks());
  frame.landmark_weights = roles.detection;
  for (int m = 0; m < model.num_landmarks(); ++m) {
    const auto i = as_size(m);
    Keypoint& keypoint = frame.evidence[0].keypoints[i];
    keypoint.x += static_cast<float>(3.0 * normal(random));
    keypoint.y += static_cast<float>(3.0 * normal(random));
    Eigen::Vector3d joint = model.landmark(now, m);
    for (double& x : joint) x += 0.02 * normal(random);
    frame.joints.push_back({m, joint, 1.0});
    frame.previous.push_back({m, model.landmark(then, m), roles.steadiness[i]});
  }
  frame.evidence[0].outline = OutlineField(mask_of(model, camera, ground_truth), frame.options.outline_pixels);
  const OutlineFinder finder(model.character(), {camera}, frame.options.outline_pixels, frame.options.outline_vertices);
  frame.outline = finder.find(frame.evidence, posed_vertices(model, then));
  return frame;
}

PoseSolution solve(const PoseFrame& frame) {
  PoseSolution found{frame.start, 0};
  found.steps = fit(*frame.model, terms_of(frame), found.dofs, frame.options.solver).iterations;
  return found;
}

int run(int count) {
  const synth::Actor actor = synth::make_actor({5514, 500, 512, 0.016});
  const Character& character = actor.character;
  const PoseModel model(character, character.skeleton.markers,
                        observable_dofs(character.skeleton, character.skeleton.markers));
  const PinholeCamera camera(synth::make_cameras(1, 960, 1).front());
  const Motion motion = synth::make_motion(character.skeleton, 6 * count + 3, 25.0, 3);
  std::mt19937 random(1);
  std::vector<PoseFrame> frames;
  for (int i = 0; i < count; ++i) {
    const auto f = as_size(6 * i);
    frames.push_back(observe(model, camera, motion.frames[f + 2], motion.frames[f], random));
  }
  std::printf("%d unknowns, %zu landmarks, %zu outline vertices, %d frames a call, one thread\n", model.num_unknowns(),
              character.skeleton.markers.size(), frames[0].outline.size(), count);
  double start = 0.0, ours = 0.0;
  int steps = 0;
  std::vector<double> reached;
  for (const PoseFrame& frame : frames) {
    const PoseSolution found = solve(frame);
    reached.push_back(cost_at(frame, found.dofs));
    start += cost_at(frame, frame.start);
    ours += reached.back();
    steps += found.steps;
  }
  std::printf("sum of costs: start %.6g, ours %.6g in %d steps\n", start, ours, steps);
  std::vector<Candidate> candidates;
#ifdef DOPPEL_HAVE_CERES
  double theirs = 0.0, difference = 0.0;
  int ceres_steps = 0;
  const auto wanted = [&](std::size_t i) { return reached[i] * (1.0 + frames[i].options.solver.function_tolerance); };
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const double known = cost_at(frames[i], frames[i].start);
    difference = std::max(difference, std::abs(ceres_start_cost(frames[i]) / known - 1.0));
    const PoseSolution found = solve_with_ceres(frames[i], wanted(i), 50);
    theirs += cost_at(frames[i], found.dofs);
    ceres_steps += found.steps;
  }
  std::printf("              Ceres %.6g in %d steps; largest difference of the costs at the start %.1e\n", theirs,
              ceres_steps, difference);
  candidates.push_back({"Ceres, to our cost", [&] {
                          for (std::size_t i = 0; i < frames.size(); ++i) solve_with_ceres(frames[i], wanted(i), 50);
                        }});
  candidates.push_back({"Ceres, as many steps as allowed us", [&] {
                          for (const PoseFrame& frame : frames)
                            solve_with_ceres(frame, 0.0, frame.options.solver.iterations);
                        }});
#endif
  candidates.push_back({"ours", [&] {
                          for (const PoseFrame& frame : frames) solve(frame);
                        }});
  compare("pose solve", candidates);
  return std::isfinite(ours) ? 0 : 1;
}

}  // namespace
}  // namespace doppel::bench

int main(int argc, char** argv) { return doppel::bench::run(argc > 1 ? std::max(1, std::atoi(argv[1])) : 5); }
