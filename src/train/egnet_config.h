#pragma once

#include "doppel/nets/egnet.h"
#include "doppel/train/pose_noise.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// The configuration of the stage `egnet`; `docs/training.md` lists the keys.
struct EgNetRunConfig {
  RunSubject subject;

  LoaderOptions loader = stage_loader(40, 40);
  PoseNoiseOptions noise;

  EgNetConfig model;
  bool standardise = true;  ///< scale the network's inputs by their statistics over the training frames
  bool recalibrate_norm =
      true;  ///< evaluate with batch-norm statistics of the whole training set instead of running statistics

  double silhouette_weight = 100.0;  ///< of the sums of squared residuals (silhouette.h), thesis A.2
  double arap_weight = 1500.0;       ///< per metre, thesis A.2
  /// Weight of the mean squared distance from the skinned surface, per square metre (anchor.h). Masks do not show how
  /// vertices slide along the surface; this term keeps the smallest deformation that explains the masks.
  double anchor_weight = 0.0;
  SilhouetteOptions silhouette;

  TrainerOptions trainer;

  /// Reads a whole configuration. @throws FileError at the key; UsageError when no capture is named
  static EgNetRunConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, EgNetRunConfig& config);

}  // namespace doppel
