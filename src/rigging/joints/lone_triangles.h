#pragma once

#include "doppel/character/character.h"
#include "doppel/rigging/weights/weight_field.h"

namespace doppel {

/// Sets the skin of a character from a field of weights, smoothed where single triangles would be torn.
///
/// Where the surface has a fold (armpit, seat) or thin triangles, weights that vary smoothly in space may differ much
/// between the corners of one triangle. In rounds, the corners of each triangle that stretches alone in a test pose
/// (StretchedTriangles) approach their mean; the other weights stay. The rounds end when there is no such triangle, or
/// after 150. Where limbs have grown together they only spread the stretch: unless there are fewer lone triangles and
/// sticking vertices in the end, the field itself becomes the skin.
/// @param character with mesh, skeleton, rest pose, and a skin that names the bones @param field [N, Bn]
void set_smooth_skin(Character& character, const WeightField& field);

}  // namespace doppel
