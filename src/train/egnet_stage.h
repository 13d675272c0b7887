#pragma once

#include <string>
#include <vector>

#include "doppel/layers/surface.h"
#include "doppel/losses/anchor.h"
#include "doppel/losses/arap.h"
#include "doppel/nets/egnet.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/egnet_config.h"

namespace doppel {

/// Trains EGNet (6.5.1) from silhouettes. The network maps a motion window to the embedded deformation of its last
/// frame. The deformed and skinned surface is compared with the masks (6.8); the graph stays as rigid as possible
/// (6.9). An anchor to the skinned surface can be added.
class EgNetStage : public CaptureStage {
 public:
  /// @param dataset, character must outlive the stage
  EgNetStage(const Dataset& dataset, const Character& character, const EgNetRunConfig& config);

  std::string name() const override { return "egnet"; }
  torch::nn::Module& model() override { return *network_; }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  void prepare_evaluation() override;
  std::vector<ReportImage> images() override;

  EgNet& network() { return network_; }

 private:
  EgNetRunConfig config_;
  EgNet network_;
  CharacterSurface surface_;
  ArapGraph arap_graph_;
  torch::Tensor faces_;  // int32 [F,3]
  PoseNoise noise_;
};

}  // namespace doppel
