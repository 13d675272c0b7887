#include "doppel/track/pose_problem.h"

namespace doppel {
namespace {

std::vector<double> to_vector(const Eigen::VectorXd& state) { return {state.data(), state.data() + state.size()}; }
Eigen::VectorXd to_eigen(const std::vector<double>& dofs) {
  return Eigen::Map<const Eigen::VectorXd>(dofs.data(), static_cast<Eigen::Index>(dofs.size()));
}

}  // namespace

PoseProblem::PoseProblem(const PoseModel& model, std::vector<std::unique_ptr<PoseTerm>> terms)
    : model_(model), terms_(std::move(terms)) {
  for (const auto& term : terms_) costs_.push_back({term->name(), 0.0});
}

double PoseProblem::cost(const Eigen::VectorXd& state) {
  const PosedBody body = model_.pose(to_vector(state), false);
  double sum = 0.0;
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    terms_[i]->evaluate(model_, body, false, rows_);
    sum += costs_[i].cost = rows_.cost();
  }
  return sum;
}

double PoseProblem::linearise(const Eigen::VectorXd& state) {
  const PosedBody body = model_.pose(to_vector(state), true);
  system_.reset(model_.num_unknowns());
  double sum = 0.0;
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    terms_[i]->freeze(model_, body);
    terms_[i]->evaluate(model_, body, true, rows_);
    sum += costs_[i].cost = rows_.cost();
    system_.add(rows_);
  }
  return sum;
}

bool PoseProblem::solve(double damping, Eigen::VectorXd& step) { return system_.solve(damping, step); }

Eigen::VectorXd PoseProblem::moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const {
  return to_eigen(model_.moved(to_vector(state), step));
}

SolverSummary fit_pose(const PoseModel& model, std::vector<std::unique_ptr<PoseTerm>> terms, std::vector<double>& dofs,
                       const SolverOptions& options) {
  PoseProblem problem(model, std::move(terms));
  Eigen::VectorXd state = to_eigen(dofs);
  const SolverSummary summary = minimise(problem, state, options);
  dofs = to_vector(state);
  return summary;
}

}  // namespace doppel
