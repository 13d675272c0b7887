#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/core/as_size.h"

namespace doppel {

/// Normal equations in which a few unknowns are shared and all others come in groups that no row connects, for instance
/// cameras and points in bundle adjustment. The groups are eliminated: only the Schur complement of the shared unknowns
/// is factorised. S shared unknowns, G groups.
class SchurSystem {
 public:
  /// The unknowns of one group, N of them.
  struct Group {
    Eigen::MatrixXd hessian;   ///< [N, N] J^T W J; both halves are filled
    Eigen::MatrixXd cross;     ///< [N, S] rows: this group's unknowns, columns: the shared ones
    Eigen::VectorXd gradient;  ///< [N] J^T W r
  };

  /// All equations become zero. @param sizes [G] number of unknowns of each group
  void reset(Eigen::Index num_shared, const std::vector<int>& sizes);

  Eigen::Index num_shared() const { return gradient_.size(); }
  std::size_t num_groups() const { return groups_.size(); }
  Eigen::MatrixXd& hessian() { return hessian_; }  ///< [S, S] of the shared unknowns; both halves are filled
  Eigen::VectorXd& gradient() { return gradient_; }
  Group& group(std::size_t index) { return groups_[index]; }

  /// Solves (H + damping diag(H)) step = -gradient. An unknown on which no row depends keeps its value.
  /// @param step out: the shared unknowns, then the groups in order
  /// @return false when the system is not positive definite or not finite
  bool solve(double damping, Eigen::VectorXd& step) const;

  /// The Schur complement of the shared unknowns without damping. A group whose equations are singular is regularised
  /// by 1e-9 times its diagonal.
  Eigen::MatrixXd reduced_hessian() const;
  /// [G] what each group adds to the gradient of the shared unknowns when it is eliminated: -cross^T hessian^-1
  /// gradient.
  std::vector<Eigen::VectorXd> reduced_gradients() const;

 private:
  Eigen::MatrixXd hessian_;
  Eigen::VectorXd gradient_;
  std::vector<Group> groups_;
};

}  // namespace doppel
