#include "doppel/track/solver/residuals.h"

#include <cmath>

namespace doppel {

double RobustKernel::cost(double s) const {
  const double limit = scale * scale;
  switch (kind) {
    case Kind::huber:
      return s <= limit ? s : 2.0 * scale * std::sqrt(s) - limit;
    case Kind::geman_mcclure:
      return limit * s / (limit + s);
    case Kind::none:
      break;
  }
  return s;
}

double RobustKernel::weight(double s) const {
  const double limit = scale * scale;
  switch (kind) {
    case Kind::huber:
      return s <= limit ? 1.0 : scale / std::sqrt(s);
    case Kind::geman_mcclure:
      return std::pow(limit / (limit + s), 2);
    case Kind::none:
      break;
  }
  return 1.0;
}

void Residuals::reset(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool slopes) {
  num_unknowns_ = num_unknowns;
  rows_per_group_ = rows_per_group;
  kernel_ = kernel;
  has_slopes_ = slopes;
  weights_.clear();
  values_.clear();
  slopes_.clear();
}

Eigen::Index Residuals::add_group(double weight) {
  const Eigen::Index first = num_rows();
  weights_.push_back(weight);
  values_.resize(values_.size() + static_cast<std::size_t>(rows_per_group_), 0.0);
  if (has_slopes_) slopes_.resize(values_.size() * static_cast<std::size_t>(num_unknowns_), 0.0);
  return first;
}

double Residuals::squared_length(Eigen::Index group) const {
  double s = 0.0;
  for (Eigen::Index row = group * rows_per_group_; row < (group + 1) * rows_per_group_; ++row)
    s += value(row) * value(row);
  return s;
}

double Residuals::cost() const {
  double sum = 0.0;
  for (Eigen::Index group = 0; group < num_groups(); ++group)
    sum += weight(group) * kernel_.cost(squared_length(group));
  return sum;
}

void Residuals::add_to(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) {
  if (num_rows() == 0) return;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<Rows> jacobian(slopes_.data(), num_rows(), num_unknowns_);
  Eigen::Map<Eigen::VectorXd> values(values_.data(), num_rows());
  for (Eigen::Index group = 0; group < num_groups(); ++group) {
    const double scale = std::sqrt(weight(group) * kernel_.weight(squared_length(group)));
    const Eigen::Index first = group * rows_per_group_;
    jacobian.middleRows(first, rows_per_group_) *= scale;
    values.segment(first, rows_per_group_) *= scale;
  }
  hessian.selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
  gradient.noalias() += jacobian.transpose() * values;
}

}  // namespace doppel
