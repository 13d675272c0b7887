#pragma once

#include "doppel/actor/trained_actor.h"
#include "doppel/losses/lighting.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// The configuration of the stage `lighting`; `docs/training.md` lists the keys.
struct LightingRunConfig {
  RunSubject subject;
  LoaderOptions loader = image_loader(4, 0);
  LightingLossOptions loss;
  double weight = 1.0;            ///< per squared level of 255
  double deviation_weight = 0.0;  ///< of Lighting::deviation(), no unit; not in the thesis
  TrainerOptions trainer;

  static LightingRunConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, LightingRunConfig& config);

/// Finds the lighting of each camera (6.6): draws the static texture on EGNet's surface and compares it with the
/// images. Only the spherical-harmonics coefficients are trained.
class LightingStage : public CaptureStage {
 public:
  /// @param dataset, actor must outlive the stage
  /// @throws UsageError when the template has no texture
  LightingStage(const Dataset& dataset, TrainedActor& actor, const LightingRunConfig& config);

  std::string name() const override { return "lighting"; }
  torch::nn::Module& model() override { return *lighting_; }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  std::string identity() const override { return CaptureStage::identity() + ", on " + actor_.digest(); }
  std::vector<ReportImage> images() override;

  Lighting& lighting() { return lighting_; }

 private:
  TrainedActor& actor_;
  LightingRunConfig config_;
  Lighting lighting_;
};

}  // namespace doppel
