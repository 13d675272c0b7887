#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "doppel/track/energy/pose_model.h"

namespace doppel {

/// The poses that a person usually takes, as a normal distribution of the joint angles. Heading and position of the
/// body are free.
struct PosePrior {
  std::vector<double> mean;    ///< [D] the root's DoFs are those of the rest pose
  Eigen::MatrixXd covariance;  ///< [n,n] of the unknowns; the root's variances are so large that it is free
};

/// Mean and covariance of the poses of some motions of the character. To the covariance is added a variance of
/// (`spread` radians)^2 of each DoF, so that poses are possible that the motions do not have.
/// @param poses [F][D] @throws Error for no poses, or poses of another number of DoFs
PosePrior learn_pose_prior(const PoseModel& model, const std::vector<std::vector<double>>& poses, double spread);

}  // namespace doppel
