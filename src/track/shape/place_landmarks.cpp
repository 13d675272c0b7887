#include "doppel/track/shape/place_landmarks.h"

#include "doppel/character/landmark_positions.h"
#include "doppel/character/landmarks.h"

namespace doppel {

std::vector<Marker> place_landmarks(const Footage& footage, const std::vector<FootageSequence>& sequences,
                                    const TrackConfig& config, int frames) {
  const std::vector<std::string> names = landmark_names(footage.landmarks());
  const LandmarkPositions family(with_markers(footage.character(), footage.landmarks()), names);
  const ShapedCharacter placed = find_shape(family, footage, sequences, config, frames, "landmarks");
  return markers_named(placed.character.skeleton, names);
}

}  // namespace doppel
