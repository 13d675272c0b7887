#include "doppel/track/shape/scale_bones.h"

#include "doppel/character/bone_scales.h"
#include "doppel/character/landmarks.h"

namespace doppel {

ScaledCharacter scale_bones(const Footage& footage, const std::vector<FootageSequence>& sequences,
                            const TrackConfig& config, int frames) {
  const BoneScales family(with_markers(footage.character(), footage.landmarks()));
  const ShapeRounds rounds;
  Progress progress("bones", frames + rounds.rounds + 1);
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
