#pragma once

#include <memory>
#include <vector>

#include "doppel/solver/least_squares.h"
#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// An energy: a sum of terms over one model. The state is what `Model::pose` takes: the whole DoF vector [D] of a
/// `PoseModel`, of which only the unknowns change, or the node parameters [6K] of a `GraphModel`.
template <typename Model>
class FitProblem : public LeastSquaresProblem {
 public:
  using Terms = std::vector<std::unique_ptr<Term<Model>>>;
  /// @param model must outlive the problem
  FitProblem(const Model& model, Terms terms) : model_(model), terms_(std::move(terms)) {
    for (const auto& term : terms_) costs_.push_back({term->name(), 0.0});
  }

  double cost(const Eigen::VectorXd& state) override {
    const auto posed = model_.pose(to_vector(state), false);
    double sum = 0.0;
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      terms_[i]->evaluate(model_, posed, false, rows_);
      sum += costs_[i].cost = rows_.cost();
    }
    return sum;
  }
  double linearise(const Eigen::VectorXd& state) override {
    const auto posed = model_.pose(to_vector(state), true);
    system_.reset(model_.num_unknowns());
    double sum = 0.0;
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      terms_[i]->linearise(model_, posed, rows_);
      sum += costs_[i].cost = rows_.cost();
      system_.add(rows_);
    }
    return sum;
  }
  bool solve(double damping, Eigen::VectorXd& step) override { return system_.solve(damping, step); }
  Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const override {
    return to_eigen(model_.moved(to_vector(state), step));
  }
  std::vector<TermCost> term_costs() const override { return costs_; }
  /// The normal equations of the last linearisation.
  const typename Model::System& system() const { return system_; }

  static std::vector<double> to_vector(const Eigen::VectorXd& state) {
    return {state.data(), state.data() + state.size()};
  }
  static Eigen::VectorXd to_eigen(const std::vector<double>& state) {
    return Eigen::Map<const Eigen::VectorXd>(state.data(), static_cast<Eigen::Index>(state.size()));
  }

 private:
  const Model& model_;
  Terms terms_;
  typename Model::System system_;
  typename Model::Rows rows_;
  std::vector<TermCost> costs_;
};

/// Fits a pose or a graph. @param state in: the initial state; out: the solution
template <typename Model>
SolverSummary fit(const Model& model, typename FitProblem<Model>::Terms terms, std::vector<double>& state,
                  const SolverOptions& options = {}) {
  FitProblem<Model> problem(model, std::move(terms));
  Eigen::VectorXd found = problem.to_eigen(state);
  const SolverSummary summary = minimise(problem, found, options);
  state = problem.to_vector(found);
  return summary;
}

}  // namespace doppel
