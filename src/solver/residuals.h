#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace doppel {

/// A robust kernel: it limits the influence of outliers. s is the squared length of a group of rows.
struct RobustKernel {
  enum class Kind {
    none,           ///< s
    huber,          ///< s up to scale^2; beyond, it grows with sqrt(s)
    geman_mcclure,  ///< scale^2 s / (scale^2 + s): at most scale^2, so gross outliers have almost no influence
  };
  Kind kind = Kind::none;
  double scale = 1.0;  ///< in the unit of the residuals

  /// The kernel of a scale. 0: no kernel, the cost is s.
  static RobustKernel geman_mcclure_of(double scale) {
    return scale > 0.0 ? RobustKernel{Kind::geman_mcclure, scale} : RobustKernel{};
  }
  double cost(double s) const;
  /// d cost / d s: the weight of a row in the normal equations.
  double weight(double s) const;
};

/// The rows of one energy term: groups with the same number of residuals (two for a pixel, three for a point). The rows
/// of a group share a weight. The energy is the sum over groups of weight * kernel(|rows|^2). Derived classes store the
/// jacobian of the rows with respect to the unknowns.
class ResidualRows {
 public:
  double& value(Eigen::Index row) { return values_[row]; }
  double value(Eigen::Index row) const { return values_[row]; }
  bool has_jacobian() const { return has_jacobian_; }
  int rows_per_group() const { return rows_per_group_; }
  Eigen::Index num_rows() const { return static_cast<Eigen::Index>(values_.size()); }
  Eigen::Index num_groups() const { return static_cast<Eigen::Index>(weights_.size()); }
  double weight(Eigen::Index group) const { return weights_[group]; }
  int num_unknowns() const { return num_unknowns_; }
  const RobustKernel& kernel() const { return kernel_; }

  double cost() const;
  /// Square root of weight * kernel's weight: the factor of the rows of a group in the normal equations.
  double factor(Eigen::Index group) const;

 protected:
  ResidualRows() = default;
  void reset_rows(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool jacobian);
  Eigen::Index add_rows(double weight);

  std::vector<double> values_;

 private:
  double squared_length(Eigen::Index group) const;
  int num_unknowns_ = 0, rows_per_group_ = 1;
  bool has_jacobian_ = false;
  RobustKernel kernel_;
  std::vector<double> weights_;
};

/// Rows that may each depend on all unknowns (some hundreds): the jacobian is dense.
class Residuals : public ResidualRows {
 public:
  /// Removes all rows. @param jacobian whether rows have a jacobian; if not, `jacobian` must not be called
  void reset(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool jacobian);
  /// Adds a group of zero rows. @return the index of its first row
  Eigen::Index add_group(double weight);

  using JacobianRow = Eigen::Map<Eigen::RowVectorXd>;
  /// [n] d value / d unknowns.
  JacobianRow jacobian(Eigen::Index row) { return {jacobian_.data() + row * num_unknowns(), num_unknowns()}; }

  /// Adds J^T W J to the lower half of `hessian` and J^T W r to `gradient`, with W = weight * kernel's weight. The
  /// function overwrites the rows: call `reset` before the next use.
  void add_to(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient);

 private:
  std::vector<double> jacobian_;
};

}  // namespace doppel
