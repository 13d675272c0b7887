#pragma once

#include "doppel/actor/trained_actor.h"
#include "doppel/losses/chroma.h"
#include "doppel/losses/laplacian.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/pose_noise.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// The configuration of the stage `deltanet`; `docs/training.md` lists the keys.
struct DeltaNetRunConfig {
  RunSubject subject;
  LoaderOptions loader = image_loader(8, 40);
  PoseNoiseOptions noise;

  DeltaNetConfig model;
  bool standardise = true;  ///< scale the network's inputs by their statistics over the training frames

  double chroma_weight = 0.03775;    ///< per squared level of 255, thesis A.2
  double silhouette_weight = 500.0;  ///< of the sums of squared residuals (silhouette.h), thesis A.2
  double laplacian_weight = 1e5;     ///< per squared metre, thesis A.2
  LaplacianOptions laplacian;
  double anchor_weight = 0.0;  ///< per squared metre of the mean squared distance from EGNet's surface
  ChromaOptions chroma;
  SilhouetteOptions silhouette;
  bool lit = true;              ///< draw with the trained lighting (false: an ablation)
  bool target_gradient = true;  ///< add the gradient of the filmed image to that of the drawn image

  TrainerOptions trainer;

  static DeltaNetRunConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, DeltaNetRunConfig& config);

/// Trains DeltaNet (6.7): displacements on top of EGNet's surface. Losses: silhouettes, chroma of the images, and a
/// Laplacian that keeps the displacements smooth (6.15). Not in the thesis: `anchor`, which keeps vertices at their
/// position on EGNet's surface where the images do not move them.
class DeltaNetStage : public CaptureStage {
 public:
  /// @param dataset, actor must outlive the stage
  /// @throws UsageError when the chroma loss is on and the template has no texture, or the lighting was not trained
  DeltaNetStage(const Dataset& dataset, TrainedActor& actor, const DeltaNetRunConfig& config);

  std::string name() const override { return "deltanet"; }
  torch::nn::Module& model() override { return *network_; }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  std::string identity() const override { return CaptureStage::identity() + ", on " + actor_.digest(); }
  std::vector<ReportImage> images() override;

  DeltaNet& network() { return network_; }

 private:
  LossTerm chroma(const Batch& batch, const torch::Tensor& vertices, Profile& profile);
  /// V_co and V_fi of motion windows, both [B,N,3], without noise.
  std::pair<torch::Tensor, torch::Tensor> surfaces(const torch::Tensor& dof_window);

  TrainedActor& actor_;
  DeltaNetRunConfig config_;
  DeltaNet network_;
  LaplacianGraph laplacian_graph_;
  PoseNoise noise_;
};

}  // namespace doppel
