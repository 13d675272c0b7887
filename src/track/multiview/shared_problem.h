#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "doppel/track/energy/fit_problem.h"

namespace doppel {

/// Several fits with common unknowns, for example one for each frame. The energy is the sum of theirs. All models have
/// the same unknowns.
template <typename Model>
class SharedProblem : public LeastSquaresProblem {
 public:
  /// The state of a part of the problem, from the common state.
  using StateOfPart = std::function<Eigen::VectorXd(const Eigen::VectorXd&)>;

  /// @param model must outlive the problem @param state_of empty: the common state itself
  void add(const Model& model, typename FitProblem<Model>::Terms terms, StateOfPart state_of = {}) {
    parts_.push_back({&model, FitProblem<Model>(model, std::move(terms)), std::move(state_of)});
  }

  double cost(const Eigen::VectorXd& state) override {
    double sum = 0.0;
    for (Part& part : parts_) sum += part.problem.cost(part.state(state));
    return sum;
  }
  double linearise(const Eigen::VectorXd& state) override {
    system_.reset(parts_.front().model->num_unknowns());
    double sum = 0.0;
    for (Part& part : parts_) {
      sum += part.problem.linearise(part.state(state));
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
    const Model* model;
    FitProblem<Model> problem;
    StateOfPart state_of;
    Eigen::VectorXd state(const Eigen::VectorXd& common) const { return state_of ? state_of(common) : common; }
  };
  std::vector<Part> parts_;
  typename Model::System system_;
};

}  // namespace doppel
