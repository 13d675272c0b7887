#include "doppel/track/multiview/shared_dofs_fit.h"

#include "doppel/core/error.h"
#include "doppel/track/energy/outline.h"
#include "doppel/track/energy/terms/limit_term.h"
#include "doppel/track/energy/terms/prior_term.h"
#include "doppel/track/multiview/shared_problem.h"

namespace doppel {
namespace {

constexpr int kRounds = 6;  // in each, outlines are found again: fingers may move far

FitProblem<PoseModel>::Terms priors(const Character& character, const MultiviewOptions& options) {
  FitProblem<PoseModel>::Terms terms;
  if (options.limit_weight > 0.0) terms.push_back(std::make_unique<LimitTerm>(options.limit_weight));
  if (options.prior_weight > 0.0)
    terms.push_back(std::make_unique<PriorTerm>("prior", character.rest_dofs, options.prior_weight));
  return terms;
}

void check(const PoseModel& model, const std::vector<int>& dofs, const std::vector<PosedEvidence>& frames) {
  if (frames.empty()) fail("there is no frame to find usual values from");
  for (const int dof : dofs)
    if (model.moves_root(dof))
      fail<UsageError>("DoF {} moves the whole body, so it cannot be a shared DoF",
                       model.character().skeleton.dofs[dof].name);
}

}  // namespace

std::vector<double> fit_shared_dofs(const Character& character, const std::vector<Marker>& landmarks,
                                    const std::vector<PinholeCamera>& cameras, const std::vector<int>& dofs,
                                    const std::vector<PosedEvidence>& frames, const MultiviewOptions& options) {
  const PoseModel model(character, landmarks, dofs);
  check(model, dofs, frames);
  const OutlineFinder outlines(character, cameras, options.outline_vertices);
  std::vector<double> found = character.rest_dofs;
  for (int round = 0; round < kRounds; ++round) {
    SharedProblem<PoseModel> problem;
    for (const PosedEvidence& frame : frames) {
      // Each frame keeps its own values of the other DoFs.
      const auto pose_of = [&](const Eigen::VectorXd& state) {
        Eigen::VectorXd pose = FitProblem<PoseModel>::to_eigen(frame.dofs);
        for (const int dof : dofs) pose[dof] = state[dof];
        return pose;
      };
      const auto pose = FitProblem<PoseModel>::to_vector(pose_of(FitProblem<PoseModel>::to_eigen(found)));
      const auto outline = outlines.find(frame.seen, posed_vertices(model, model.pose(pose, false)));
      problem.add(model, image_terms<PoseModel>(cameras, frame.seen, outline, options), pose_of);
    }
    problem.add(model, priors(character, options));
    Eigen::VectorXd state = FitProblem<PoseModel>::to_eigen(found);
    minimise(problem, state, options.solver);
    found = FitProblem<PoseModel>::to_vector(state);
  }
  std::vector<double> values;
  values.reserve(dofs.size());
  for (const int dof : dofs) values.push_back(found[dof]);
  return values;
}

}  // namespace doppel
