#pragma once

/// Corrective shapes whose weights follow the bones: what a program computes in a frame instead of running networks.

#include <Eigen/Geometry>
#include <vector>

namespace doppel {

/// Inputs are read from the rotations and positions of the bones now and at some times before. An affine function of
/// them and one hidden layer give the weights of the shapes, which are 0 to 1:
///
///   z = clamp((x - mean) * scale, -limit, limit)
///   weights = clamp(offset + linear z + output tanh(hidden_offset + hidden z), 0, 1)
///
/// x has 3 + 6 L numbers for each of the B bones, bone after bone, L = number of lags. v(q) stands for twice the
/// imaginary part of the rotation q, with the sign that makes its real part positive; R and p are rotation (q: as a
/// quaternion) and position of the bone in the world, y up, metres.
///
/// - of a bone with a parent: v(rest^-1 q_parent^-1 q), its rotation from the rest pose; of one without: R^T (0, 1, 0),
///   so that the heading does not matter;
/// - for each lag: R^T (p(t - lag) - p(t)), and v(q(t)^-1 q(t - lag)), the way it came and the turn it made.
struct CorrectiveFunction {
  std::vector<int> parents;              ///< [B] -1: none
  std::vector<Eigen::Quaterniond> rest;  ///< [B] relative to the parent in the rest pose; to the world without one
  std::vector<double> lags;              ///< [L] seconds, positive, rising
  float limit = 4.0F;                    ///< of standardised inputs
  Eigen::VectorXf mean, scale;           ///< [I]; scale 0: the input is not used
  Eigen::MatrixXf linear;                ///< [K, I]
  Eigen::VectorXf offset;                ///< [K]
  Eigen::MatrixXf hidden;                ///< [H, I]
  Eigen::VectorXf hidden_offset;         ///< [H]
  Eigen::MatrixXf output;                ///< [K, H]

  Eigen::Index num_inputs() const;
  Eigen::Index num_weights() const { return offset.size(); }
  /// x. @param poses [L + 1][B] bones to world: now, and at each lag before @return [I]
  Eigen::VectorXf inputs(const std::vector<std::vector<Eigen::Affine3d>>& poses) const;
  /// @param inputs x [I] @return [K] 0 to 1
  Eigen::VectorXf weights(const Eigen::VectorXf& inputs) const;
};

/// Helper joints that follow the bones. The function gives 6 numbers of each of the N helpers, one after the other:
/// translation and rotation vector (axis times angle) relative to its parent bone, as shares of a range.
struct HelperFunction {
  CorrectiveFunction shares;  ///< K = 6 N
  Eigen::VectorXf low, high;  ///< [6N] what shares of 0 and 1 stand for, metres and radians

  /// [N] helpers to their parent bones. @param inputs x [I]
  std::vector<Eigen::Affine3d> transforms(const Eigen::VectorXf& inputs) const;
};

}  // namespace doppel
