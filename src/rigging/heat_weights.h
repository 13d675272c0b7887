#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "doppel/character/skinning_weights.h"
#include "doppel/geometry/mesh.h"
#include "doppel/rigging/solid_grid.h"

namespace doppel {

/// A source of heat: the bone's name and the line segments that it consists of, metres in the rest pose.
struct HeatBone {
  std::string name;
  std::vector<std::array<Eigen::Vector3d, 2>> segments;
};

struct HeatOptions {
  int max_bones = 6;              ///< of a vertex
  double smallest_weight = 0.01;  ///< smaller weights are dropped, and the others are scaled to sum 1
  double thickness = 0.25;        ///< of a bone: the share of its distance to the surface that it fills
  double sharpness = 2.0;         ///< power of the weights; above 1 the transition at a joint becomes shorter
  double air = 1e-4;              ///< conduction of the cells around the body, relative to those inside
  double wall = 0.1;  ///< conduction through a surface inside of the solid: skin under clothes, touching limbs
  int smoothing = 3;  ///< rounds of averaging over the edges of the mesh
};

/// Skinning weights by heat that flows through the body. Bone i has temperature 1 in field i and 0 in the other fields.
/// The weight of a vertex is the steady temperature there. The fields are solutions of the Laplace equation in the
/// cells inside the body, with no flow through the surface except the little that the air conducts. So the weights are
/// not negative, sum to 1, vary smoothly, and heat takes the way through the body: an arm does not heat the trunk
/// beside it. The mesh only says where the temperature is read: holes, open borders and several components do no harm.
/// Vertices at equal positions have equal weights.
/// @param mesh [N] vertices in the coordinates of the grid, metres
/// @param bones in the order of SkinningWeights::bones
/// @return sorted, largest first
/// @throws Error without bones, for a bone whose segments all lie outside of the grid, an empty solid, or when the
///   equations are not solved in 2000 iterations
SkinningWeights heat_weights(const TriangleMesh& mesh, const std::vector<HeatBone>& bones, const SolidGrid& solid,
                             const HeatOptions& options = {});

}  // namespace doppel
