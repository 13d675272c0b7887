#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "doppel/actor/export/correctives/helper_skin.h"

namespace doppel {

/// A surface in F frames, and the bones under it. V vertices, B bones.
struct SkinnedFrames {
  Eigen::MatrixXd vertices;                         ///< [3F, V] metres: rows 3t to 3t + 2 are frame t
  std::vector<std::vector<Eigen::Affine3d>> bones;  ///< [F][B] rigid: from where a bone is at rest to where it is
};

struct HelperOptions {
  int helpers = 32;  ///< N
  int rounds = 12;   ///< in which transforms, weights and rest vertices are found in turn
};

/// Finds the helper joints with which linear blend skinning comes nearest to a surface that does more than follow its
/// bones. The method is Smooth Skinning Decomposition with Rigid Bones (B. H. Le and Z. Deng, SIGGRAPH Asia 2012),
/// which lowers the sum over frames and vertices of
///
///   | sum_j w_j M_j rest - vertex |^2
///
/// by finding the transforms of each joint in each frame, and the weights of each vertex, in turn. Both have solutions
/// in closed form. Here the bones of the skeleton stay where they are, and the rest vertices are found too.
///
/// The first helpers are groups of neighbouring vertices with the same dominant bone, which becomes their parent: each
/// is made at the vertex that skin and helpers before it leave farthest away. A vertex keeps some of the bones that it
/// had, and may get helpers of those bones that share vertices with its dominant bone.
/// @param skin its joints are the bones; its rest vertices hold where the frames do not determine them
/// @throws Error without frames, when there are fewer vertices than helpers, or when the user asks to stop
HelperSkin find_helpers(const SkinnedFrames& frames, const LinearSkin& skin, const HelperOptions& options);

}  // namespace doppel
