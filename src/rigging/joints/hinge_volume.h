#pragma once

#include "doppel/character/character.h"
#include "doppel/rigging/weights/weight_field.h"

namespace doppel {

/// Changes the weights at elbows and knees so that the limb keeps its volume when it bends.
///
/// Where the bones below a hinge have the weight w, a point p (from the joint) turns by the angle w theta about the
/// axis a. This motion changes the volume by theta times the integral of (a x p) . grad w (hinge volume). If w depends
/// on the position along the limb alone, the limb loses theta times its cross-section times the distance of the
/// section's middle from the axis, towards the inner side of the joint, however long the transition between the bones
/// is. Joints of people do lie off the middle, and clothes move the middle.
///
/// So the transition becomes longer on the outer side and shorter on the inner side, or the other way round for a limb
/// that gains: w^q / (w^q + (1 - w)^q) replaces w, with q = exp(c s t) for the share s of the limb's radius on the
/// inner side of the middle and the closeness t to the joint. c is the number that keeps the volume of the limb's piece
/// (LimbPiece), within limits that keep the transition monotonic.
/// @param field [N, Bn] heat_field @param character with mesh, skeleton, rest pose and the joints of its bones
void keep_hinge_volumes(WeightField& field, const Character& character);

}  // namespace doppel
