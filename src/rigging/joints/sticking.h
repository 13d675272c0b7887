#pragma once

#include <vector>

#include "doppel/character/blend_skin.h"
#include "doppel/character/character.h"

namespace doppel {

/// Finds the vertices of one limb that another limb drags along.
///
/// A bone may move the skin around itself and around the bones at most two steps away in the tree of bones: hand and
/// forearm, upper arm and chest, both thighs through the pelvis, but not hand and thigh. A vertex could belong to each
/// bone whose distance from it in the rest pose is at most twice the usual one of that bone (the median over the
/// vertices that it moves most) or, for the hands, the toes and the head, 0.7 of the bone's length: a thumb stands off.
/// It could also belong to the bone that is nearest in this sense. In a pose, the vertex has a position for each bone
/// that it could belong to: where the weights of that bone and of those within two steps alone take it. It sticks if it
/// is farther from all these positions than a share of the body's height.
///
/// A vertex that a wrong limb moves entirely is not found where both limbs are so near that it could belong to either.
class StickingVertices {
 public:
  /// The distance from which a vertex sticks, as a share of the height of the template.
  static constexpr double kShareOfHeight = 0.02;

  /// @param character must outlive this object
  explicit StickingVertices(const Character& character);

  /// The vertices that stick in a pose, ascending. @param posed [N] = blend.vertices(...)
  std::vector<int> find(const SkinBlend& blend, const std::vector<Eigen::Vector3d>& posed) const;

 private:
  Eigen::Vector3d position_by(const SkinBlend& blend, int vertex, int bone) const;

  const Character& character_;
  IndexRows owners_;                        ///< [N] the bones that a vertex could belong to
  std::vector<std::vector<bool>> related_;  ///< [Bn][Bn] at most two steps apart
  double tolerance_;                        ///< metres
};

}  // namespace doppel
