#pragma once

#include <vector>

#include "doppel/character/motion.h"
#include "doppel/synth/actor.h"
#include "doppel/synth/cloth_solver.h"
#include "doppel/synth/clothing.h"

namespace doppel::synth {

/// Simulates the clothes of the actor as near-inextensible cloth that touches the body.
///
/// The outer face of the skirt and the pullover are cloth; vertices below the looseness `pinned` (waistband, collar,
/// shoulders, cuffs) and all other vertices follow the skinned body. The skirt touches the trunk, the legs, the hands
/// and the forearms (`PosedBody`, `SkinPatch`). The pullover is so close to the body that each vertex touches only the
/// plane of the skin below its own skinned position; this plane moves with the blended skin and never contradicts it.
/// The inner wall of the skirt is not cloth: it follows the outer face at its distance. Cloth does not touch cloth.
///
/// @param worn skinned positions of all vertices of the worn clothes, per frame, world metres
/// @param motion the poses of these frames
/// @return the true surface per frame. The simulation starts at rest in the shape of `worn`: pass a lead-in of about a
/// second and drop its frames.
/// The result depends only on the arguments; a frame depends on all frames before it and, because the path between
/// frames is smooth, on the next one.
/// @throws Error when the numbers of frames differ, or naming the first frame with a position that is not finite
std::vector<Points> drape_clothes(const Actor& actor, const std::vector<Points>& worn, const Motion& motion, double fps,
                                  const XpbdOptions& options = {});

/// How a vertex of the actor moves.
enum class ClothRole : char {
  skin,     ///< with the skinned body
  woven,    ///< as cloth: the outer face of the skirt
  knitted,  ///< as cloth: the pullover
  lining    ///< with the outer face of the skirt: the inner wall, its ceiling, and the tops of the trousers
};
/// [N] the role of each vertex. @param pinned see XpbdOptions
std::vector<ClothRole> cloth_roles(const Actor& actor, double pinned);

}  // namespace doppel::synth
