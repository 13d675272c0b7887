#include "doppel/track/shape/scale_bones.h"

#include <algorithm>

#include "doppel/character/bone_scales.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/as_size.h"

namespace doppel {
namespace {

constexpr int kRounds = 4;

/// The character with the landmarks as markers, which replace markers of the same names.
Character with_markers(Character character, const std::vector<Marker>& landmarks) {
  std::vector<Marker>& markers = character.skeleton.markers;
  for (const Marker& landmark : landmarks) {
    const auto same = [&](const Marker& marker) { return marker.name == landmark.name; };
    markers.erase(std::remove_if(markers.begin(), markers.end(), same), markers.end());
    markers.push_back(landmark);
  }
  return character;
}

}  // namespace

ScaledCharacter scale_bones(const Footage& footage, const std::vector<FootageSequence>& sequences,
                            const TrackConfig& config, int frames) {
  const BoneScales family(with_markers(footage.character(), footage.landmarks()));
  ShapeRounds rounds;
  rounds.rounds = kRounds;
  Progress progress("bones", frames + kRounds + 1);
  const SeenFrames seen = see_frames(footage, sequences, frames, progress);
  ShapedCharacter shaped =
      find_shape(family, landmark_names(footage.landmarks()), footage.cameras(), seen, config, rounds, progress);
  progress.finish();
  ScaledCharacter result{std::move(shaped.character), {}};
  for (std::size_t p = 0; p < shaped.parameters.size(); ++p)
    result.factors.emplace_back(family.parameters()[p].name, shaped.parameters[p]);
  return result;
}

}  // namespace doppel
