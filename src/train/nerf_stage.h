#pragma once

#include "doppel/actor/trained_actor.h"
#include "doppel/nets/plain_field.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// The configuration of the stage `nerf`; `docs/training.md` lists the keys.
struct NerfRunConfig {
  RunSubject subject;
  LoaderOptions loader = image_loader(1, 1);  ///< of one frame; `batch_size` must be 1
  PlainFieldConfig model;
  int rays = 1000;       ///< rays of a step, shared among its cameras
  double in_mask = 0.5;  ///< share of these rays drawn inside the mask
  TrainerOptions trainer;

  static NerfRunConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, NerfRunConfig& config);

/// Trains a radiance field without a mesh on one frame (6.12.5.2), for comparison. The loss compares colour and mask of
/// both of its networks. A share of the rays passes through the mask, the others through the whole image.
class NerfStage : public CaptureStage {
 public:
  /// @param dataset, actor must outlive the stage @throws UsageError unless the data is one frame
  NerfStage(const Dataset& dataset, TrainedActor& actor, const NerfRunConfig& config);

  std::string name() const override { return "nerf"; }
  /// Shares the rays of a step.
  void share_batches(Ranks&) override {}
  torch::nn::Module& model() override { return *model_; }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  /// None: the field represents a single frame.
  std::optional<double> validation_loss(std::int64_t) override { return std::nullopt; }
  bool has_validation_frames() const override { return false; }

 private:
  NerfRunConfig config_;
  PlainField model_{nullptr};
};

}  // namespace doppel
