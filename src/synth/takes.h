#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/synth/actor.h"
#include "doppel/synth/clothing.h"
#include "doppel/synth/synth_options.h"

namespace doppel::synth {

/// One continuous motion with the true surface.
struct Take {
  Motion motion;
  std::vector<Points> ground_truth;  ///< [F] of [N] world metres
};

/// The skinned positions of all vertices for every frame of a motion.
/// @param offset added to the template's vertices before skinning, [N] or empty
/// @return [F] of [N] world metres
std::vector<Points> skin_motion(const Character& character, const Motion& motion, const Points& offset);

/// Frames before a take in which the simulation of the clothes settles: 1.2 seconds.
int lead_in(double fps);

/// Simulates the clothes. @param with_lead_in the motion after `lead_in` frames that are dropped from the take
Take perform(const Actor& actor, Motion with_lead_in, double fps, const ClothOptions& cloth);

/// A take that is to be made.
struct TakePlan {
  int frames = 0;
  std::uint64_t seed = 0;      ///< of a generated motion
  std::optional<Motion> clip;  ///< the motion of a file instead
};

/// A sequence of the capture that is to be made.
struct SequencePlan {
  std::string name;  ///< `training` or `testing`
  bool training = false;
  std::vector<TakePlan> takes;

  int frames() const;
  std::vector<int> cuts() const;  ///< the first frames of all takes but the first
};

/// The training sequence and the test sequence. Reads the clips.
/// @throws UsageError or FileError for a clip that cannot be read
std::vector<SequencePlan> plan_sequences(const SynthOptions& options, const Character& character);

/// Makes a planned take.
Take perform(const Actor& actor, const TakePlan& plan, const SynthOptions& options);

}  // namespace doppel::synth
