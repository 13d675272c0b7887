#include "doppel/track/shape/scale_bones.h"

#include "doppel/character/bone_scales.h"
#include "doppel/character/landmarks.h"

namespace doppel {

ScaledCharacter scale_bones(const Footage& footage, const std::vector<FootageSequence>& sequences,
                            const TrackConfig& config, int frames) {
  const BoneScales family(with_markers(footage.character(), footage.landmarks()));
  ShapedCharacter shaped = find_shape(family, footage, sequences, config, frames, "bones");
  ScaledCharacter result{std::move(shaped.character), {}};
  for (std::size_t p = 0; p < shaped.parameters.size(); ++p)
    result.factors.emplace_back(family.parameters()[p].name, shaped.parameters[p]);
  return result;
}

}  // namespace doppel
