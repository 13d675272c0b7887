#pragma once

/// Forward kinematics: from DoFs to the world transforms of joints, bones and markers.
///
///   q_j = sum over DoFs d of weight_jd * dof_d
///   A_j = A_parent(j) * Trans(offset_j) * X_j,  X_j = Rot(axis_j, q_j) or Trans(axis_j * q_j)
///
/// The chain is composed in double precision for every type of the DoFs, and rounded once at the output, so that
/// positions several metres from the origin are exact to micrometres.
/// Letters: B batch, D DoFs, J joints, Bn bones, M markers.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <vector>

#include "doppel/character/character.h"

namespace doppel {

/// A skeleton as tensors on the CPU, which both the reference and the kernel read.
struct KinematicChain {
  explicit KinematicChain(const Skeleton& skeleton);

  torch::Tensor parent;         ///< int32 [J], smaller than the joint's own index, -1 for a root
  torch::Tensor prismatic;      ///< int32 [J], 1 for joints that translate
  torch::Tensor geometry;       ///< float64 [J,6]: offset (metres), axis
  torch::Tensor drive_offsets;  ///< int32 [J+1]: row j of the two below are the DoFs that drive joint j
  torch::Tensor drive_dof;      ///< int32 [E]
  torch::Tensor drive_weight;   ///< float64 [E]
  int64_t num_joints = 0, num_dofs = 0;

  // The same for the reference, with an additional joint J that never moves.
  /// int64 [J+1] each: round r maps a joint to its 2^r-th ancestor, or to J when there is none.
  std::vector<torch::Tensor> ancestors;
  torch::Tensor weights;  ///< float64 [D,J+1]: the drives as a matrix
  torch::Tensor skew,
      skew_squared;             ///< float64 [J+1,3,3]: the cross product with the axis (revolute, else 0), its square
  torch::Tensor offset, slide;  ///< float64 [J+1,3]; slide is the axis of a prismatic joint, else 0
};

/// M coordinate frames fixed to joints: frame m is A_joint(m) * local_m.
struct RiddenFrames {
  torch::Tensor joint;  ///< int32 [M]
  torch::Tensor local;  ///< float64 [M,3,4]
};

/// Frames at landmarks, oriented like their joints. @param markers [M]
/// @throws UsageError for a marker on a joint that the skeleton does not have
RiddenFrames marker_frames(const Skeleton& skeleton, const std::vector<Marker>& markers);

/// World transforms of frames fixed to joints.
/// @param dofs [B,D] in the units of the skeleton's file (its weights turn them into radians and metres)
/// @return [B,M,3,4] world-from-frame, metres, in the type of `dofs`
/// Gradient: exact, to `dofs`, also for joints with several DoFs and DoFs with several joints.
/// @throws Error for another shape or type
torch::Tensor forward_kinematics(const torch::Tensor& dofs, const KinematicChain& chain, const RiddenFrames& frames);

/// The same in plain tensor operations: any device and float type, differentiable any number of times, traceable.
torch::Tensor forward_kinematics_reference(const torch::Tensor& dofs, const KinematicChain& chain,
                                           const RiddenFrames& frames);

/// Kinematics of a character.
class KinematicsImpl : public torch::nn::Module {
 public:
  explicit KinematicsImpl(const Character& character);

  /// @param dofs [B,D] @return [B,J,3,4] world-from-joint
  torch::Tensor joints(const torch::Tensor& dofs) const;
  /// @param dofs [B,D] @return [B,Bn,3,4] skinning transforms A_b(theta) A_b(rest)^-1, the identity in the rest pose
  torch::Tensor bones(const torch::Tensor& dofs) const;
  /// @param dofs [B,D] @return [B,M,3] world positions, metres
  torch::Tensor markers(const torch::Tensor& dofs) const;

  int64_t num_dofs() const { return chain_.num_dofs; }
  int64_t num_joints() const { return chain_.num_joints; }
  void pretty_print(std::ostream& stream) const override;

 private:
  // Not registered as buffers: they belong to the character, must stay double, and are not part of a checkpoint.
  KinematicChain chain_;
  RiddenFrames joint_frames_, bone_frames_, marker_frames_;
};
TORCH_MODULE(Kinematics);

}  // namespace doppel
