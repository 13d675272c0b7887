#include "doppel/fit/shared_dofs_fit.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/energy/outline.h"
#include "doppel/energy/terms/limit_term.h"
#include "doppel/energy/terms/prior_term.h"

namespace doppel {
namespace {

constexpr int kRounds = 6;  // in each, outlines are found again: fingers may move far

/// Several fits with common unknowns, the shared DoFs; each part keeps its own values of the other DoFs. The state is a
/// DoF vector [D], of which only the shared DoFs are read.
class SharedProblem : public LeastSquaresProblem {
 public:
  /// @param shared the unknowns of `model`
  SharedProblem(const PoseModel& model, const std::vector<int>& shared) : model_(model), shared_(shared) {}
  /// @param dofs of the frame
  void add(std::vector<double> dofs, FitProblem<PoseModel>::Terms terms) {
    parts_.push_back({std::move(dofs), FitProblem<PoseModel>(model_, std::move(terms))});
  }

  double cost(const Eigen::VectorXd& state) override {
    double sum = 0.0;
    for (Part& part : parts_) sum += part.problem.cost(state_of(part, state));
    return sum;
  }
  double linearise(const Eigen::VectorXd& state) override {
    system_.reset(model_.num_unknowns());
    double sum = 0.0;
    for (Part& part : parts_) {
      sum += part.problem.linearise(state_of(part, state));
      system_.add(part.problem.system());
    }
    return sum;
  }
  bool solve(double damping, Eigen::VectorXd& step) override { return system_.solve(damping, step); }
  Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const override {
    return parts_.front().problem.moved(state, step);
  }
  std::vector<TermCost> term_costs() const override { return {}; }

 private:
  struct Part {
    std::vector<double> dofs;
    FitProblem<PoseModel> problem;
  };
  Eigen::VectorXd state_of(const Part& part, const Eigen::VectorXd& state) const {
    Eigen::VectorXd full = FitProblem<PoseModel>::to_eigen(part.dofs);
    for (const int dof : shared_) full[dof] = state[dof];
    return full;
  }

  const PoseModel& model_;
  const std::vector<int>& shared_;
  std::vector<Part> parts_;
  DenseSystem system_;
};

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
                       model.character().skeleton.dofs[as_size(dof)].name);
}

}  // namespace

std::vector<double> fit_shared_dofs(const Character& character, const std::vector<Marker>& landmarks,
                                    const std::vector<PinholeCamera>& cameras, const std::vector<int>& dofs,
                                    const std::vector<PosedEvidence>& frames, const MultiviewOptions& options) {
  const PoseModel model(character, landmarks, dofs);
  check(model, dofs, frames);
  const OutlineFinder outlines(character, cameras, options.outline_pixels, options.outline_vertices);
  std::vector<double> found = character.rest_dofs;
  for (int round = 0; round < kRounds; ++round) {
    SharedProblem problem(model, dofs);
    for (const PosedEvidence& frame : frames) {
      std::vector<double> pose = frame.dofs;
      for (const int dof : dofs) pose[as_size(dof)] = found[as_size(dof)];
      const auto outline = outlines.find(frame.seen, posed_vertices(model, model.pose(pose, false)));
      problem.add(std::move(pose), image_terms(cameras, frame.seen, outline, options));
    }
    problem.add(character.rest_dofs, priors(character, options));
    Eigen::VectorXd state = FitProblem<PoseModel>::to_eigen(found);
    minimise(problem, state, options.solver);
    found = FitProblem<PoseModel>::to_vector(state);
  }
  std::vector<double> values;
  values.reserve(dofs.size());
  for (const int dof : dofs) values.push_back(found[as_size(dof)]);
  return values;
}

}  // namespace doppel
