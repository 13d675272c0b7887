#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/track/energy/pose_model.h"

namespace doppel {

/// How a body moves between two frames. Weights are those of an energy: per squared radian and squared metre.
struct MotionOptions {
  double turn_weight = 1e6;   ///< of the change of a DoF's velocity from frame to frame; 0: no filter
  double shift_weight = 3e7;  ///< of the change of the root's velocity
};

/// A Kalman filter over the unknowns of a pose x and their velocities v, without lag:
///   v' = v + a,   x' = x + v',   a normal with the variances 1 / weight.
/// What the frames so far leave uncertain (depth, and rotations that one camera hardly sees) is averaged over many
/// frames; what each frame determines well follows at once. The unit of variance is that of the energy: a term of
/// weight w stands for a measurement of variance 1 / w.
class MotionFilter {
 public:
  explicit MotionFilter(const MotionOptions& options) : options_(options) {}

  bool empty() const { return dofs_.empty(); }
  void clear() { dofs_.clear(); }
  /// The next pose as its mean and covariance. @pre not empty()
  struct Prediction {
    std::vector<double> dofs;    ///< [D]
    Eigen::MatrixXd covariance;  ///< [n,n] of the unknowns
  };
  Prediction predicted(const PoseModel& model) const;
  /// Begins with a pose at rest. Stays empty when the pose's energy leaves an unknown undetermined.
  /// @param hessian [n,n] of half its energy, lower half
  void start(const PoseModel& model, const std::vector<double>& dofs, const Eigen::MatrixXd& hessian);
  /// Adds the pose of the next frame. @param hessian [n,n] of half its energy, the predicted distribution included;
  /// lower half. Empties the filter when it is not positive definite.
  void add(const PoseModel& model, const std::vector<double>& dofs, const Eigen::MatrixXd& hessian);

 private:
  /// Variances of a.
  Eigen::VectorXd noise(const PoseModel& model) const;

  MotionOptions options_;
  std::vector<double> dofs_;                                  ///< [D] of the last frame
  Eigen::VectorXd velocity_;                                  ///< [n]
  Eigen::MatrixXd of_pose_, of_pose_velocity_, of_velocity_;  ///< [n,n] the covariance of (x, v), by blocks
};

}  // namespace doppel
