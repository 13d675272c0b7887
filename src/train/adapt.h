#pragma once

/// Domain adaptation (5.7, A.1.3): the networks of a studio run are tuned to the one camera of a clip.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "doppel/core/config.h"

namespace doppel {

/// How one network is tuned.
struct AdaptStage {
  std::int64_t iterations = 250;  ///< 0: it stays as it is
  double learning_rate = 1e-6;
  int batch_size = 8;
  bool freeze_norm = false;  ///< batch normalisation keeps the studio's statistics

  static AdaptStage read(const ConfigReader& reader);
};

/// What `configs/*/adapt.yaml` holds; docs/training.md lists the keys. By default what the thesis did.
struct AdaptConfig {
  std::int64_t seed = 1;
  double held_out = 0.2;          ///< share of the clip's frames, the last ones, that only judges
  std::int64_t check_every = 25;  ///< steps between the states that are judged
  AdaptStage posenet, defnet;

  /// @throws FileError at the key
  static AdaptConfig read(const ConfigDocument& document);
};

struct AdaptOptions {
  std::filesystem::path run;      ///< of the chain `deepcap`, or of posenet alone
  std::filesystem::path capture;  ///< the clip, prepared; it needs masks and keypoints but no motion
  std::filesystem::path out;      ///< the new run; the studio's is only read
  std::string camera;             ///< of the clip; empty: its first
  AdaptConfig config;
};

/// Trains PoseNet and then DefNet on all but the held-out frames with the losses of a single view, and of each network
/// keeps the state that does best on the held-out ones: PoseNet by the distance of keypoints, DefNet by IoU. Where no
/// state beats the studio's, that one stays. `out` becomes a run like any other, with `adapt.json` and
/// `evaluation.json`: what is returned, and `adapt.yaml`: what was asked for. A call that was stopped goes on when it
/// is repeated.
/// @return {"protocol": ..., "splits": {"held out, before", "held out, after", "clip, before", "clip, after"}}, each
/// with the methods posenet and defnet: `AMVIoU` and `keypoint_error_px` (mean distance of landmarks from confident
/// keypoints, pixels of an image 1024 wide)
/// @throws UsageError when `out` holds another run or was asked for other settings, which it names; when the clip has
/// too few frames
nlohmann::ordered_json adapt(const AdaptOptions& options);

}  // namespace doppel
