#pragma once

#include <cstdint>
#include <string>

#include "doppel/geometry/camera.h"
#include "doppel/synth/actor.h"
#include "doppel/synth/cloth_solver.h"
#include "doppel/synth/clothing.h"

namespace doppel::synth {

/// How the clothes move: damped springs to the skinned position (clothing.h), or near-inextensible cloth that touches
/// the body (xpbd_cloth.h).
enum class ClothModel { springs, xpbd };
/// @throws UsageError for a word that is not `springs` or `xpbd`
ClothModel cloth_model(const std::string& name);
std::string cloth_name(ClothModel model);

/// The lens of a word: `pinhole` (Lens::opencv without distortion) or `fisheye`. @throws UsageError for another word
Lens synth_lens(const std::string& name);

struct ClothOptions {
  ClothModel model = ClothModel::springs;
  ClothingOptions springs;
  XpbdOptions xpbd;
};

/// The body that the actor has by itself.
inline constexpr const char* kOwnBody = "actor";

struct SynthOptions {
  ActorOptions actor;
  std::string body = kOwnBody;  ///< `actor`, or another body: `average`, `random:SEED` (other_body.h)
  ClothOptions cloth;
  int cameras = 8;
  int size = 384;            ///< pixels along each side of the images
  Lens lens = Lens::opencv;  ///< opencv: no distortion; fisheye: action cameras near the person
  int frames = 120;          ///< for training, in two segments with a cut between them
  int test_frames = 40;
  double fps = 25;
  double turn = 0.0;       ///< mean speed at which the person turns about the vertical axis, degrees per second
  std::uint64_t seed = 1;  ///< of motions, cameras and noise, not of the actor
  bool force = false;      ///< replace a synthetic capture in the folder

  /// `tiny` (seconds to make) or `small` (a minute or two). @throws UsageError for another word
  static SynthOptions preset(const std::string& name);
};

}  // namespace doppel::synth
