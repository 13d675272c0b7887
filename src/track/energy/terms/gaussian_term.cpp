#include "doppel/track/energy/terms/gaussian_term.h"

#include <Eigen/Cholesky>

#include "doppel/core/error.h"

namespace doppel {

GaussianTerm::GaussianTerm(std::string name, std::vector<double> mean, const Eigen::MatrixXd& covariance)
    : name_(std::move(name)), mean_(std::move(mean)) {
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success) fail("the covariance of the term {} is not positive definite", name_);
  whitening_ = factor.matrixL().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
}

void GaussianTerm::evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const {
  const Eigen::Index n = model.num_unknowns();
  rows.reset(model.num_unknowns(), 1, {}, jacobian);
  const Eigen::VectorXd step = model.step_between(mean_, body.dofs);
  const Eigen::VectorXd residuals = whitening_.triangularView<Eigen::Lower>() * step;
  Eigen::MatrixXd derivative;
  if (jacobian) {
    derivative = whitening_;
    if (model.root()) derivative.rightCols<3>() = whitening_.rightCols<3>() * step_derivative(step.tail<3>());
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index row = rows.add_group(1.0);
    rows.value(row) = residuals[i];
    if (jacobian) rows.jacobian(row) = derivative.row(i);
  }
}

}  // namespace doppel
