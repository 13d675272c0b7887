#include "doppel/solver/residuals.h"

#include <cmath>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/solver/squared_rows_kernel.h"

namespace doppel {
namespace {

/// Sums outer products of rows. The rows go to the kernel in panels that fit the first-level cache, with their value as
/// an additional column, padded with zeros.
class Sum {
 public:
  explicit Sum(Eigen::Index unknowns)
      : unknowns_(unknowns),
        panel_(Rows::Zero(kPanelRows, (unknowns + kernels::kPanelStep) / kernels::kPanelStep * kernels::kPanelStep)),
        sum_(Rows::Zero(panel_.cols(), panel_.cols())) {}

  void add(double scale, const Residuals::JacobianRow& jacobian, double value) {
    panel_.row(filled_).head(unknowns_) = scale * jacobian;
    panel_(filled_, unknowns_) = scale * value;
    if (++filled_ == kPanelRows) flush();
  }
  void add_to(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) {
    flush();
    hessian.triangularView<Eigen::Lower>() += sum_.topLeftCorner(unknowns_, unknowns_).transpose();
    gradient += sum_.col(unknowns_).head(unknowns_);
  }

 private:
  static constexpr Eigen::Index kPanelRows = 64;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  void flush() {
    kernels::add_squared_rows(panel_.data(), filled_, panel_.cols(), sum_.data());
    filled_ = 0;
  }
  Eigen::Index unknowns_, filled_ = 0;
  Rows panel_, sum_;
};

/// The only unknown that a row depends on, if there is just one, as in rows of single DoFs.
std::optional<Eigen::Index> only_unknown(const Residuals::JacobianRow& jacobian) {
  std::optional<Eigen::Index> found;
  for (Eigen::Index u = 0; u < jacobian.size(); ++u) {
    if (jacobian[u] == 0.0) continue;
    if (found) return std::nullopt;
    found = u;
  }
  return found;
}

}  // namespace

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

void ResidualRows::reset_rows(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool jacobian) {
  num_unknowns_ = num_unknowns;
  rows_per_group_ = rows_per_group;
  kernel_ = kernel;
  has_jacobian_ = jacobian;
  weights_.clear();
  values_.clear();
}

Eigen::Index ResidualRows::add_rows(double weight) {
  const Eigen::Index first = num_rows();
  weights_.push_back(weight);
  values_.resize(values_.size() + as_size(rows_per_group_), 0.0);
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

void Residuals::reset(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool jacobian) {
  reset_rows(num_unknowns, rows_per_group, kernel, jacobian);
  jacobian_.clear();
}

Eigen::Index Residuals::add_group(double weight) {
  const Eigen::Index first = add_rows(weight);
  if (has_jacobian()) jacobian_.resize(values_.size() * as_size(num_unknowns()), 0.0);
  return first;
}

void Residuals::add_to(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) {
  std::optional<Sum> sum;
  for (Eigen::Index row = 0; row < num_rows(); ++row) {
    const double scale = factor(row / rows_per_group());
    const JacobianRow derivatives = jacobian(row);
    if (const auto only = only_unknown(derivatives)) {
      hessian(*only, *only) += std::pow(scale * derivatives[*only], 2);
      gradient[*only] += scale * derivatives[*only] * scale * value(row);
      continue;
    }
    if (!sum) sum.emplace(num_unknowns());
    sum->add(scale, derivatives, value(row));
  }
  if (sum) sum->add_to(hessian, gradient);
}

}  // namespace doppel
