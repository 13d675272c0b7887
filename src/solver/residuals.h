#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace doppel {

/// How much a residual counts that is larger than it should be. s is the squared length of a group of rows.
struct RobustKernel {
  enum class Kind {
    none,           ///< s
    huber,          ///< s up to scale^2, then growing with sqrt(s)
    geman_mcclure,  ///< scale^2 s / (scale^2 + s): never more than scale^2, so gross outliers lose their pull
  };
  Kind kind = Kind::none;
  double scale = 1.0;  ///< in the unit of the residuals

  double cost(double s) const;
  /// d cost / d s: what a row is weighted with in the normal equations.
  double weight(double s) const;
};

/// The rows of one energy term: groups of equally many residuals (two for a pixel, three for a point) that share a
/// weight. Its energy is the sum over groups of weight * kernel(|rows|^2). How the jacobian of the rows with respect to
/// the unknowns are kept is the affair of those below.
class ResidualRows {
 public:
  double& value(Eigen::Index row) { return values_[static_cast<std::size_t>(row)]; }
  double value(Eigen::Index row) const { return values_[static_cast<std::size_t>(row)]; }
  bool has_jacobian() const { return has_jacobian_; }
  int rows_per_group() const { return rows_per_group_; }
  Eigen::Index num_rows() const { return static_cast<Eigen::Index>(values_.size()); }
  Eigen::Index num_groups() const { return static_cast<Eigen::Index>(weights_.size()); }
  double weight(Eigen::Index group) const { return weights_[static_cast<std::size_t>(group)]; }
  int num_unknowns() const { return num_unknowns_; }
  const RobustKernel& kernel() const { return kernel_; }

  double cost() const;
  /// Square root of weight * kernel's weight: what the rows of a group are multiplied with in the normal equations.
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

/// Rows that may depend on any of some hundred unknowns.
class Residuals : public ResidualRows {
 public:
  /// Empties it. @param jacobian whether rows carry jacobian this time; without, `jacobian` must not be asked for
  void reset(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool jacobian);
  /// Adds a group of zero rows. @return the index of its first row
  Eigen::Index add_group(double weight);

  using JacobianRow = Eigen::Map<Eigen::RowVectorXd>;
  /// [n] d value / d unknowns
  JacobianRow jacobian(Eigen::Index row) { return {jacobian_.data() + row * num_unknowns(), num_unknowns()}; }

  /// Adds J^T W J to the lower half of `hessian` and J^T W r to `gradient`, with W = weight * kernel's weight. The
  /// rows are used up: `reset` before the next use.
  void add_to(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient);

 private:
  std::vector<double> jacobian_;
};

}  // namespace doppel
