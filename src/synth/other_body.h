#pragma once

#include <span>
#include <string>
#include <vector>

#include "doppel/synth/actor.h"

namespace doppel::synth {

/// The measures of a body by its word: `average` (the mean of women and men) or `random:SEED`
/// (rigging/body/measures.h).
/// @return [P] metres @throws UsageError for another word
std::vector<double> measures_of(const std::string& body);

/// The measures of the actor itself [P], metres: its lengths between joints, and for the rest those of an average
/// woman.
std::vector<double> actor_measures();

/// Warps the actor to another body: mesh, worn clothes, skeleton, landmarks and rest pose. Lengths between joints
/// become those of the measures. The actor counts as an average woman otherwise: its girths, head, hands and feet
/// change as the measures do from hers. The clothes, the skirt included, are warped with the body. Hair and
/// looseness are not used. Topology, weights, labels, graph and shading stay. Fills `part_warps`.
/// @param measures [P] metres
void give_body(Actor& actor, std::span<const double> measures);

}  // namespace doppel::synth
