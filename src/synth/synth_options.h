#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/core/shard.h"
#include "doppel/geometry/camera.h"
#include "doppel/synth/actor.h"
#include "doppel/synth/cloth_solver.h"

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
  XpbdOptions xpbd;
};

/// The body that the actor has by itself.
inline constexpr const char* kOwnBody = "actor";

/// What the person does: moves on the spot (performance.h), or moves about in the studio (repertoire.h).
enum class Movements { on_the_spot, varied };

struct SynthOptions {
  ActorOptions actor;
  std::string body = kOwnBody;  ///< `actor`, or another body: `average`, `random:SEED` (other_body.h)
  ClothOptions cloth;
  int cameras = 8;
  int size = 384;            ///< pixels along each side of the images
  Lens lens = Lens::opencv;  ///< opencv: no distortion; fisheye: action cameras near the person
  int frames = 120;          ///< for training, besides those of `clips`
  int test_frames = 40;
  /// About how many frames a take has, with a cut between takes; 0: training in two takes, testing in one.
  int take_frames = 0;
  Movements movements = Movements::on_the_spot;
  double room = 0;  ///< metres from the centre to which a person with varied movements walks
  /// Motions in files (read_motion_file), one take each, after the others. A person who goes farther than 0.6 m from
  /// the middle of the area of the way stays above one point.
  std::vector<std::filesystem::path> clips, test_clips;
  bool keypoint_tables = false;  ///< one table of keypoints per camera instead of one file per image
  double fps = 25;
  double turn = 0.0;       ///< mean speed at which the person turns on the spot about the vertical, degrees per second
  std::uint64_t seed = 1;  ///< of motions, cameras and noise, not of the actor
  bool force = false;      ///< replace a synthetic capture in the folder
  int threads = 1;         ///< takes that are simulated, and cameras that film, at a time
  /// Film only the cameras of this shard, into a folder that is not renamed: camera c of sequence s is unit s*C + c.
  std::optional<Shard> shard{};
  /// Folders of all shards, by their index: take surfaces and films from there instead of making them.
  std::vector<std::filesystem::path> shards{};

  /// `tiny` (seconds to make), `small` (a minute or two) or `studio` (half an hour). @throws UsageError for another
  /// word
  static SynthOptions preset(const std::string& name);
};

/// @throws UsageError for options out of range, or that exclude each other
void check_options(const SynthOptions& options);

}  // namespace doppel::synth
