#pragma once

#include <vector>

#include "doppel/geometry/mesh.h"
#include "doppel/rigging/weights/heat_bone.h"
#include "doppel/rigging/weights/solid_grid.h"
#include "doppel/rigging/weights/weight_field.h"

namespace doppel {

/// Skinning weights by heat that flows through the body. Bone i has temperature 1 in field i and 0 in the other fields.
/// The weight of a vertex is the steady temperature there. The fields are solutions of the Laplace equation in the
/// cells inside the body, with no flow through the surface except the little that the air conducts. So the weights are
/// not negative, sum to 1, vary smoothly, and heat takes the way through the body: an arm does not heat the trunk
/// beside it. The mesh only says where the temperature is read: holes, open borders and several components do no harm.
/// Vertices at equal positions have equal weights.
/// @param mesh [N] vertices in the coordinates of the grid, metres
/// @param bones in the order of SkinningWeights::bones
/// @return [N, Bn]
/// @throws Error without bones, for a bone whose segments all lie outside of the grid, an empty solid, or when the
///   equations are not solved in 2000 iterations
WeightField heat_field(const TriangleMesh& mesh, const std::vector<HeatBone>& bones, const SolidGrid& solid);

}  // namespace doppel
