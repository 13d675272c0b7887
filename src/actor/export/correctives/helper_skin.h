#pragma once

/// A skin with helper joints: rigid joints besides the bones of a skeleton, each a child of one of them.
///
/// V vertices, B bones, N helpers, F frames. Transforms are rigid; M of a joint moves what is at rest to where it is in
/// a frame.

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <vector>

namespace doppel {

/// Linear blend skinning with at most four joints a vertex.
struct LinearSkin {
  std::vector<Eigen::Vector3d> rest;         ///< [V] metres
  std::vector<std::array<int, 4>> joint;     ///< [V] 0 where the weight is 0
  std::vector<std::array<float, 4>> weight;  ///< [V] not negative, largest first; the sum is 1
};

struct HelperSkin {
  LinearSkin skin;                    ///< joints 0 to B - 1 are the bones, B + h is helper h
  int bones = 0;                      ///< B
  std::vector<int> parents;           ///< [N] bones
  std::vector<Eigen::Affine3d> mean;  ///< [N] M_parent^-1 M_helper, the mean over the frames of the fit
};

/// Poses the helpers of a skin under a surface: each by weighted Procrustes with the others fixed, several times in
/// turn. A small pull towards the mean makes the result unique.
class HelperPoser {
 public:
  /// @param skin must outlive the poser, and its weights must not change
  explicit HelperPoser(const HelperSkin& skin);

  /// @param bones [B] M @param vertices [3, V] metres @return [N] M of the helpers
  std::vector<Eigen::Affine3d> pose(const std::vector<Eigen::Affine3d>& bones, const Eigen::Matrix3Xd& vertices) const;
  /// One turn, from known helpers. @param helpers [N] M, which come nearer to the surface
  void improve(const std::vector<Eigen::Affine3d>& bones, const Eigen::Matrix3Xd& vertices,
               std::vector<Eigen::Affine3d>& helpers) const;
  /// [N] M of the helpers at their mean.
  std::vector<Eigen::Affine3d> at_mean(const std::vector<Eigen::Affine3d>& bones) const;

  /// The mean of the rest vertices that a helper moves, weighted by the squares of its weights, metres. Without any: 0.
  const Eigen::Vector3d& centre(std::size_t helper) const { return parts_[helper].centre; }
  /// How many vertices a helper moves: the sum of the squares of its weights.
  double reach(std::size_t helper) const { return parts_[helper].squares; }

 private:
  struct Member {
    std::size_t vertex;
    double weight;
  };
  struct Part {
    std::vector<Member> members;
    double squares = 0.0;  ///< sum of w^2
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();  ///< sum of w^2 (rest - centre) (rest - centre)^T
  };
  Eigen::Affine3d nearest(const Part& part, const Eigen::Matrix3Xd& left, const Eigen::Affine3d& before,
                          const Eigen::Affine3d& mean) const;
  void turn(const std::vector<Eigen::Affine3d>& means, Eigen::Matrix3Xd& left,
            std::vector<Eigen::Affine3d>& helpers) const;

  const HelperSkin& skin_;
  std::vector<Part> parts_;  ///< [N]
};

/// What joints leave of a surface: its vertices minus sum_j w_j M_j rest. @param joints [B + N] M @return [3, V]
Eigen::Matrix3Xd left_by(const LinearSkin& skin, const std::vector<Eigen::Affine3d>& joints, Eigen::Matrix3Xd vertices);

/// @return [B + N]: the bones, then the helpers
std::vector<Eigen::Affine3d> all_joints(std::vector<Eigen::Affine3d> bones,
                                        const std::vector<Eigen::Affine3d>& helpers);

}  // namespace doppel
