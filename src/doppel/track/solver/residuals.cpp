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

void ResidualRows::reset_rows(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool slopes) {
  num_unknowns_ = num_unknowns;
  rows_per_group_ = rows_per_group;
  kernel_ = kernel;
  has_slopes_ = slopes;
  weights_.clear();
  values_.clear();
}

Eigen::Index ResidualRows::add_rows(double weight) {
  const Eigen::Index first = num_rows();
  weights_.push_back(weight);
  values_.resize(values_.size() + static_cast<std::size_t>(rows_per_group_), 0.0);
  return first;
}

double ResidualRows::squared_length(Eigen::Index group) const {
  double s = 0.0;
  for (Eigen::Index row = group * rows_per_group_; row < (group + 1) * rows_per_group_; ++row)
    s += value(row) * value(row);
  return s;
}

double ResidualRows::cost() const {
  double sum = 0.0;
  for (Eigen::Index group = 0; group < num_groups(); ++group)
    sum += weight(group) * kernel_.cost(squared_length(group));
  return sum;
}

double ResidualRows::factor(Eigen::Index group) const {
  return std::sqrt(weight(group) * kernel_.weight(squared_length(group)));
}

void Residuals::reset(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool slopes) {
  reset_rows(num_unknowns, rows_per_group, kernel, slopes);
  slopes_.clear();
}

Eigen::Index Residuals::add_group(double weight) {
  const Eigen::Index first = add_rows(weight);
  if (has_slopes()) slopes_.resize(values_.size() * static_cast<std::size_t>(num_unknowns()), 0.0);
  return first;
}

void Residuals::add_to(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) {
  if (num_rows() == 0) return;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<Rows> jacobian(slopes_.data(), num_rows(), num_unknowns());
  Eigen::Map<Eigen::VectorXd> values(values_.data(), num_rows());
  for (Eigen::Index group = 0; group < num_groups(); ++group) {
    const double scale = factor(group);
    const Eigen::Index first = group * rows_per_group();
    jacobian.middleRows(first, rows_per_group()) *= scale;
    values.segment(first, rows_per_group()) *= scale;
  }
  hessian.selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
  gradient.noalias() += jacobian.transpose() * values;
}

}  // namespace doppel
