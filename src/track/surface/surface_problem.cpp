#include "doppel/track/surface/surface_problem.h"

#include "doppel/core/as_size.h"
#include "doppel/solver/parallel.h"

namespace doppel {

SurfaceProblem::SurfaceProblem(int num_vertices, const std::vector<Link>& edges, int iterations)
    : system_(num_vertices, edges), iterations_(iterations) {}

void SurfaceProblem::set_terms(std::vector<SurfaceTerm*> terms) {
  terms_ = std::move(terms);
  priced_.resize(0);
  costs_.clear();
  for (const SurfaceTerm* term : terms_) costs_.push_back({term->name(), 0.0});
}

std::size_t SurfaceProblem::num_elements(const SurfaceTerm& term) const {
  return as_size(term.element() == SurfaceTerm::Element::vertex ? system_.num_points() : system_.num_links());
}

double SurfaceProblem::cost_of(const SurfaceTerm& term, const Vertices& vertices) const {
  return sum_in_order(num_elements(term), [&](std::size_t first, std::size_t last) {
    double sum = 0.0;
    for (std::size_t e = first; e < last; ++e) sum += term.rows(static_cast<int>(e), vertices).cost();
    return sum;
  });
}

/// Each thread sums its own parts, so that no two threads add to the same vertex or edge.
double SurfaceProblem::add(const SurfaceTerm& term, const Vertices& vertices) {
  const bool at_vertices = term.element() == SurfaceTerm::Element::vertex;
  return sum_in_order(num_elements(term), [&](std::size_t first, std::size_t last) {
    double sum = 0.0;
    for (std::size_t e = first; e < last; ++e) {
      const int element = static_cast<int>(e);
      const PointRows rows = term.rows(element, vertices);
      if (rows.count == 0) continue;
      sum += rows.cost();
      if (at_vertices)
        system_.add_at_point(element, rows);
      else
        system_.add_at_link(element, rows);
    }
    return sum;
  });
}

double SurfaceProblem::cost(const Eigen::VectorXd& state) {
  const bool known = priced_.size() == state.size() && priced_ == state;
  double sum = 0.0;
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    if (!known) costs_[i].cost = cost_of(*terms_[i], vertices(state));
    sum += costs_[i].cost;
  }
  priced_ = state;
  return sum;
}

double SurfaceProblem::linearise(const Eigen::VectorXd& state) {
  system_.reset();
  priced_ = state;
  double sum = 0.0;
  for (std::size_t i = 0; i < terms_.size(); ++i) {
    terms_[i]->freeze(vertices(state));
    sum += costs_[i].cost = add(*terms_[i], vertices(state));
  }
  return sum;
}

bool SurfaceProblem::solve(double damping, Eigen::VectorXd& step) { return system_.solve(damping, iterations_, step); }

}  // namespace doppel
