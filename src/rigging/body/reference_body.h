#pragma once

#include "doppel/character/character.h"
#include "doppel/geometry/distance_field.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {

/// The body that all others are warped from: the mean of women and men, without hair and loose clothes, in an A-pose.
struct ReferenceBody {
  BodyJoints joints;    ///< the 21 joints and all extra points
  Character character;  ///< mesh with UVs, skinning weights, labels, graph
};

/// The joints of the reference body, from mean_measures(). Metres, y up, facing +z, left x > 0, soles at y = 0.
BodyJoints reference_joints();
/// Its surface: smooth unions of round cones and ellipsoids. Symmetric in x.
DistanceField reference_field();
/// Meshes and rigs the reference body.
/// @throws Error when the counts cannot be reached
ReferenceBody make_reference_body(int num_vertices, int num_nodes);

}  // namespace doppel
