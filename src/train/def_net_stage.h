#pragma once

#include "doppel/actor/trained_pose.h"
#include "doppel/layers/landmarks/landmarks.h"
#include "doppel/losses/arap.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// The configuration of the stage `defnet`; `docs/training.md` lists the keys.
struct DefNetRunConfig {
  RunSubject subject;
  LoaderOptions loader = stage_loader(50, 0);
  BackboneConfig model;
  double silhouette_weight = 1000.0;       ///< of the sums of squared residuals (silhouette.h), thesis A.1.2
  double keypoint_weight = 0.05;           ///< per squared reference pixel (image 1024 wide), thesis A.1.2
  double arap_weight = 1500.0;             ///< per metre, thesis A.1.2
  SilhouetteOptions silhouette{1.0, 0.0};  ///< 5.11 has the first sum of 6.8 only
  TrainerOptions trainer;

  /// Reads a whole configuration. @throws FileError at the key; UsageError when no capture is named
  static DefNetRunConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, DefNetRunConfig& config);

/// Trains DefNet (5.6) on the poses of a fixed PoseNet. Losses: silhouettes (5.11, or both sums of 6.8), landmarks on
/// the graph (5.12), ARAP (5.13).
class DefNetStage : public CaptureStage {
 public:
  /// @param dataset, pose must outlive the stage
  DefNetStage(const Dataset& dataset, TrainedPose& pose, const DefNetRunConfig& config);

  std::string name() const override { return "defnet"; }
  torch::nn::Module& model() override { return *network_; }
  void begin() override { network_->backbone()->load_pretrained(); }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  std::string identity() const override { return CaptureStage::identity() + ", on " + pose_.digest(); }
  std::vector<ReportImage> images() override;

  DefNet& network() { return network_; }

 private:
  TrainedPose& pose_;
  DefNetRunConfig config_;
  DefNet network_;
  GraphLandmarks graph_landmarks_;
  ArapGraph arap_graph_;
  torch::Tensor faces_;  ///< int32 [F,3]
};

}  // namespace doppel
