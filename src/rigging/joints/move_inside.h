#pragma once

#include "doppel/rigging/joints/body_joints.h"
#include "doppel/rigging/weights/solid_grid.h"

namespace doppel {

/// Moves joints so that bones lie inside of the limbs. Elbow, wrist, knee and ankle move to the middle of the limb's
/// cross-section, perpendicular to the bones; along the limb they move only as far as both sides agree. Hip and
/// shoulder have no middle that the shape could tell: they move only when they lie outside or too near to the surface,
/// or when the two sides disagree. A cross-section that holds more than the limb (armpit, crotch, skirt, a hand on the
/// hip) does not move the joint. The trunk's joints stay. No joint of a body of 1.7 m moves by more than 6 cm.
void move_inside(BodyJoints& joints, const SolidGrid& solid);

}  // namespace doppel
