#pragma once

/// Domain adaptation (5.7, A.1.3): fine-tunes the networks of a studio run to the camera of a clip.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "doppel/core/config.h"
#include "doppel/core/options.h"

namespace doppel {

/// How one network is fine-tuned.
struct AdaptStage {
  std::int64_t iterations = 250;  ///< 0: the network is not changed
  double learning_rate = 1e-6;
  int batch_size = 90;
  bool freeze_norm = false;  ///< batch normalisation keeps the studio's statistics
};

struct AdaptPoseNet : AdaptStage {
  double keypoints = 1e-6;  ///< weight of the keypoint loss, per squared reference pixel
};

/// Weights of the losses as in `DefNetRunConfig`; nothing: that of the studio run. The thesis has 1000, 0.05 and 1500.
struct AdaptDefNet : AdaptStage {
  std::optional<double> silhouette, keypoints, arap;
};

/// The content of `configs/*/adapt.yaml`; docs/training.md lists the keys. Defaults are those of the thesis (A.1.3):
/// the networks are tuned on all frames of the clip, and the last step is kept.
struct AdaptConfig {
  AdaptConfig() { defnet.batch_size = 50; }

  std::int64_t seed = 1;
  double held_out = 0.0;          ///< share of the clip's frames, the last ones, that are used only to evaluate
  double validation = 0.0;        ///< share of the frames before these, which choose the checkpoint; 0: the last step
  std::int64_t check_every = 25;  ///< steps between the checkpoints that are evaluated
  AdaptPoseNet posenet;
  AdaptDefNet defnet;

  /// @throws FileError at the key
  static AdaptConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, AdaptConfig& config);

struct AdaptOptions {
  std::filesystem::path run;      ///< the studio run: of the chain `deepcap`, or of posenet alone
  std::filesystem::path capture;  ///< prepared capture of the clip; it needs masks and keypoints but no motion
  std::filesystem::path out;      ///< the new run; the studio run is only read
  std::string camera;             ///< of the clip; empty: its first
  AdaptConfig config;
};

/// Trains PoseNet and then DefNet with the losses of a single view, on all frames that are neither held out nor for
/// validation. Of each network it keeps the checkpoint that is best on the validation frames: PoseNet by the distance
/// of keypoints, DefNet by IoU. If no checkpoint is better than the studio's network, that one is kept. Without
/// validation frames it keeps the last checkpoint. `out` becomes a run with `adapt.json` and `evaluation.json`, the
/// returned report, and `adapt.yaml`, the settings. A repeated call resumes a stopped one.
/// @return {"protocol": ..., "splits": {"held out, before", "held out, after", "tuned on, before", "tuned on, after"}};
/// those with held-out frames only if there are such frames. Each has the methods posenet and defnet: `AMVIoU` and
/// `keypoint_error_px` (mean distance of landmarks from confident keypoints, pixels of an image 1024 wide)
/// @throws UsageError when `out` holds another run or one with other settings (the message names them), or when the
/// clip has too few frames
nlohmann::ordered_json adapt(const AdaptOptions& options);

}  // namespace doppel
