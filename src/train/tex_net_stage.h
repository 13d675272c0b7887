#pragma once

#include "doppel/actor/trained_actor.h"
#include "doppel/losses/photometric.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/pose_noise.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// The configuration of the stage `texnet`; `docs/training.md` lists the keys.
struct TexNetRunConfig {
  RunSubject subject;
  LoaderOptions loader = image_loader(12, 1);
  PoseNoiseOptions noise;
  TexNetConfig model;
  double weight = 1.0;  ///< per level of 255; per squared level with `loss.squares`
  PhotometricOptions loss;
  bool nearest = false;  ///< draw with the nearest texel
  TrainerOptions trainer;

  static TexNetRunConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, TexNetRunConfig& config);

/// Trains TexNet (6.8): a dynamic texture for a motion window and a camera. The texture is drawn without lighting on
/// the final geometry and compared with the camera's image (6.18).
class TexNetStage : public CaptureStage {
 public:
  /// @param dataset, actor must outlive the stage
  /// @throws UsageError when the template has no UVs, or no texture to add to (model.residual)
  TexNetStage(const Dataset& dataset, TrainedActor& actor, const TexNetRunConfig& config);

  std::string name() const override { return "texnet"; }
  torch::nn::Module& model() override { return *network_; }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  std::string identity() const override { return CaptureStage::identity() + ", on " + actor_.digest(); }
  std::vector<ReportImage> images() override;

  TexNet& network() { return network_; }

 private:
  TrainedActor& actor_;
  TexNetRunConfig config_;
  TexNet network_;
  TextureSpace texture_space_;
  PoseNoise noise_;
};

}  // namespace doppel
