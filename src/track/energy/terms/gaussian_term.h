#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// A normal distribution over all unknowns of a pose. With the mean m and the covariance C = L L^T the residuals are
///   L^-1 d,   d = step from m to the pose (`PoseModel::step_between`),
/// so that the energy is the squared Mahalanobis distance d^T C^-1 d. Unlike the other terms of a pose, it knows how
/// sure each direction is, for example that depth is uncertain where the position in the image is not.
class GaussianTerm : public PoseTerm {
 public:
  /// @param mean [D] @param covariance [n,n] of the unknowns, in their own units; positive definite
  /// @throws Error for a covariance that is not
  GaussianTerm(std::string name, std::vector<double> mean, const Eigen::MatrixXd& covariance);

  std::string name() const override { return name_; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;

 private:
  std::string name_;
  std::vector<double> mean_;
  Eigen::MatrixXd whitening_;  ///< L^-1, lower triangle
};

}  // namespace doppel
