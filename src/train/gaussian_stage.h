#pragma once

#include "doppel/actor/trained_actor.h"
#include "doppel/data/dataset/studio_crops.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// The configuration of the stage `gaussians`; `docs/training.md` lists the keys.
struct GaussiansRunConfig {
  RunSubject subject;
  LoaderOptions loader = image_loader(4, 1);
  GaussiansConfig model;
  double photometric = 1.0, similarity = 200.0, silhouette = 20.0, offset = 0.1, scale = 10.0;  ///< weights
  double largest_scale = 3.0;  ///< distances of texels, without a penalty
  bool studio = true;          ///< compare over the empty studio, where the capture has it
  TrainerOptions trainer;

  static GaussiansRunConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, GaussiansRunConfig& config);

/// Trains the Gaussians on the surface of an actor. They are drawn on the final geometry and compared with the images
/// over the empty studio, up to two pixels beyond the mask. Pixels of the outline mix the colours of person and studio;
/// over the studio, the Gaussians mix them too, and do not learn the studio's colour. Without images of the empty
/// studio, drawing and person are compared over black.
class GaussianStage : public CaptureStage {
 public:
  /// @param dataset, actor must outlive the stage
  /// @throws UsageError when the template has no UVs or no texture; Error when an image of the empty studio that the
  /// capture names cannot be used
  GaussianStage(const Dataset& dataset, TrainedActor& actor, const GaussiansRunConfig& config);

  std::string name() const override { return "gaussians"; }
  torch::nn::Module& model() override { return *gaussians_; }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  std::string identity() const override { return CaptureStage::identity() + ", on " + actor_.digest(); }
  std::vector<ReportImage> images() override;

 private:
  TrainedActor& actor_;
  GaussiansRunConfig config_;
  TextureSpace space_;
  Gaussians gaussians_;
  StudioCrops studio_;
};

}  // namespace doppel
