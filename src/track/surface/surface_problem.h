#pragma once

#include <memory>
#include <vector>

#include "doppel/solver/least_squares.h"
#include "doppel/solver/point_system.h"
#include "doppel/track/surface/surface_term.h"

namespace doppel {

/// The energy of a surface (4.7) as a least-squares problem. The state is the vertices one after the other, [3N] world
/// metres. Costs and steps are bitwise independent of the number of threads.
class SurfaceProblem : public LeastSquaresProblem {
 public:
  /// @param edges of the mesh @param iterations of conjugate gradients for each step
  SurfaceProblem(int num_vertices, const std::vector<Link>& edges, int iterations);

  /// Sets the terms to minimise. @param terms must outlive the following calls
  void set_terms(std::vector<SurfaceTerm*> terms);

  double cost(const Eigen::VectorXd& state) override;
  double linearise(const Eigen::VectorXd& state) override;
  bool solve(double damping, Eigen::VectorXd& step) override;
  std::vector<TermCost> term_costs() const override { return costs_; }

  const PointSystem& system() const { return system_; }

 private:
  using Vertices = Eigen::Map<const Eigen::Matrix3Xd>;
  Vertices vertices(const Eigen::VectorXd& state) const { return {state.data(), 3, system_.num_points()}; }
  std::size_t num_elements(const SurfaceTerm& term) const;
  double cost_of(const SurfaceTerm& term, const Vertices& vertices) const;
  double add(const SurfaceTerm& term, const Vertices& vertices);

  PointSystem system_;
  int iterations_;
  std::vector<SurfaceTerm*> terms_;
  std::vector<TermCost> costs_;
  Eigen::VectorXd priced_;  ///< the state of `costs_`
};

}  // namespace doppel
