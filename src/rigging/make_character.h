#pragma once

#include <string>

#include "doppel/character/character.h"
#include "doppel/rigging/joints/body_joints.h"
#include "doppel/rigging/weights/solid_grid.h"

namespace doppel {

/// Makes the character of a body from its mesh and joints: skeleton, weights, markers, labels, rigidity, embedded
/// graph. The graph is decimated from the outer surface of the solid, not from the mesh: the mesh may have several
/// components, open borders and non-manifold edges.
/// @param mesh the template in the rest pose, metres, y up
/// @param joints at least the twelve limb joints; see complete_joints and move_inside
/// @param solid the space inside of the mesh
/// @throws Error as make_body_skeleton and heat_field
Character make_character(const std::string& name, const TriangleMesh& mesh, const BodyJoints& joints,
                         const SolidGrid& solid, const CharacterOptions& options = {});

}  // namespace doppel
