#pragma once

#include <cstdint>
#include <string>

#include "doppel/synth/actor.h"
#include "doppel/synth/clothing.h"

namespace doppel::synth {

struct SynthOptions {
  ActorOptions actor;
  ClothingOptions clothing;
  int cameras = 8;
  int size = 384;    ///< pixels along each side of the images
  int frames = 120;  ///< for training, in two segments with a cut between them
  int test_frames = 40;
  double fps = 25;
  std::uint64_t seed = 1;  ///< of motions, cameras and noise; the actor is always the same
  bool force = false;      ///< replace a synthetic capture in the folder

  /// `tiny` (seconds to make) or `small` (a minute or two). @throws UsageError for another word
  static SynthOptions preset(const std::string& name);
};

}  // namespace doppel::synth
