#pragma once

#include "doppel/track/shape/shape_and_poses.h"

namespace doppel {

/// A character with the bone lengths of the person in a capture.
struct ScaledCharacter {
  Character character;
  /// Name and factor of each pair of bones (BoneScales).
  std::vector<std::pair<std::string, double>> factors;
};

/// Finds the lengths of a character's bones over many frames together, for a body that is not quite this person's.
/// The landmarks of the capture become markers of the character.
/// @param frames of all sequences together
/// @throws Error when no frame can be fitted
ScaledCharacter scale_bones(const Footage& footage, const std::vector<FootageSequence>& sequences,
                            const TrackConfig& config, int frames = 24);

}  // namespace doppel
