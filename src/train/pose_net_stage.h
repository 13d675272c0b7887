#pragma once

#include <string>
#include <vector>

#include "doppel/actor/person_input.h"
#include "doppel/layers/landmarks/landmarks.h"
#include "doppel/layers/surface.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/pose_phase.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// The DoFs that PoseNet predicts where the configuration names none: the joint angles that landmarks determine
/// (`determined_dofs`), or all joint angles of the skeleton, as in 5.5.
enum class AngleChoice { determined, all };

/// The configuration of the stage `posenet`; `docs/training.md` lists the keys.
struct PoseNetRunConfig {
  RunSubject subject;
  LoaderOptions loader = stage_loader(90, 0);
  std::vector<std::string> dofs;  ///< patterns of PoseDofs; empty: `angles`
  AngleChoice angles = AngleChoice::determined;
  PoseNetConfig model;
  PosePhases phases;
  DetectionOptions detections;
  TrainerOptions trainer;

  /// Reads a whole configuration. @throws FileError at the key; UsageError when no capture is named
  static PoseNetRunConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, PoseNetRunConfig& config);

/// Trains PoseNet (5.5) from the keypoints of many cameras. The network predicts joint angles and the root's rotation
/// from an image; global alignment finds the position. The loss compares landmarks with their keypoints (5.6).
class PoseNetStage : public CaptureStage {
 public:
  /// @param dataset, character must outlive the stage
  /// @throws UsageError when the capture was prepared without keypoints
  PoseNetStage(const Dataset& dataset, const Character& character, const PoseNetRunConfig& config);

  std::string name() const override { return "posenet"; }
  torch::nn::Module& model() override { return *network_; }
  void begin() override { network_->backbone()->load_pretrained(); }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  std::vector<ReportImage> images() override;

  PoseNet& network() { return network_; }
  const PoseDofs& pose() const { return pose_; }
  /// The poses that the network predicts for a batch.
  CapturedPose capture(const Batch& batch);

 private:
  PoseNetRunConfig config_;
  PoseDofs pose_;
  Landmarks landmarks_;
  std::vector<std::string> landmark_names_;
  PoseNet network_;
  CharacterSurface surface_;
  torch::Tensor faces_;  ///< int32 [F,3]
};

}  // namespace doppel
