#include "doppel/track/energy/terms/level_term.h"

#include <cmath>

namespace doppel {

void LevelTerm::weigh(const Residuals& rows) {
  shares_.assign(rows.num_rows(), 0.0);
  double sum = 0.0;
  for (Eigen::Index row = 0; row < rows.num_rows(); ++row) sum += shares_[row] = std::pow(rows.factor(row), 2);
  if (sum > 0.0)
    for (double& share : shares_) share /= sum;
}

void LevelTerm::level(Residuals& rows) const {
  double mean = 0.0;
  Eigen::RowVectorXd slope = Eigen::RowVectorXd::Zero(rows.has_jacobian() ? rows.num_unknowns() : 0);
  for (Eigen::Index row = 0; row < rows.num_rows(); ++row) {
    mean += shares_[row] * rows.value(row);
    if (rows.has_jacobian()) slope += shares_[row] * rows.jacobian(row);
  }
  for (Eigen::Index row = 0; row < rows.num_rows(); ++row) {
    rows.value(row) -= mean;
    if (rows.has_jacobian()) rows.jacobian(row) -= slope;
  }
}

void LevelTerm::freeze(const PoseModel& model, const PosedBody& body) {
  term_->freeze(model, body);
  Residuals rows;
  term_->evaluate(model, body, false, rows);
  weigh(rows);
}

void LevelTerm::evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const {
  term_->evaluate(model, body, jacobian, rows);
  level(rows);
}

void LevelTerm::linearise(const PoseModel& model, const PosedBody& body, Residuals& rows) {
  term_->linearise(model, body, rows);
  weigh(rows);
  level(rows);
}

}  // namespace doppel
