#pragma once

#include <string>
#include <vector>

#include "doppel/layers/landmarks/landmarks.h"
#include "doppel/layers/surface.h"
#include "doppel/losses/keypoints.h"
#include "doppel/nets/pose_capture.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/pose_phase.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// What counts as a detection, in the alignment and in the losses alike.
struct DetectionOptions {
  GlobalAlignmentOptions alignment;
  KeypointLossOptions loss;

  /// Keys `confidence_threshold` and `binary_alignment` of a section `loss`.
  static DetectionOptions read(const ConfigReader& loss);
};

/// Everything a run of the stage `posenet` is made of; `docs/training.md` lists the keys.
struct PoseNetRunConfig {
  RunSubject subject;
  LoaderOptions loader;
  std::vector<std::string> dofs;  ///< patterns of PoseDofs
  BackboneConfig model;
  PosePhases phases;
  DetectionOptions detections;
  TrainerOptions trainer;

  /// Reads a whole configuration. @throws FileError at the key; UsageError when no capture is named
  static PoseNetRunConfig read(const ConfigDocument& document);
};

/// What the batch shows of each person, and the rays of its keypoints in all of its cameras.
PersonView person_view(const Batch& batch);
/// The loader's options with people's pictures of a side, and keypoints; without a motion window.
LoaderOptions with_people(LoaderOptions options, int person_size);
/// Frames as a network sees them in evaluation: nothing is drawn at random, the picture is that of the first of the
/// cameras in which the person is seen.
/// @param cameras whose keypoints come along
Batch person_batch(const Dataset& dataset, const std::vector<SampleId>& samples, const std::vector<int>& cameras,
                   int person_size);
/// A frame in the cameras that a loader draws from.
Batch person_batch(const Dataset& dataset, const SampleId& sample, const LoaderOptions& options);
/// The batch's keypoints as the losses take them. @param counts bool [B]: people whose keypoints count at all
KeypointTarget keypoint_target(const Batch& batch, const torch::Tensor& counts);

/// Trains PoseNet (5.5) from the keypoints of many cameras: a picture gives joint angles and the root's rotation,
/// global alignment the place, and the landmarks are compared with their detections (5.6).
class PoseNetStage : public CaptureStage {
 public:
  /// @param dataset, character must outlive the stage
  /// @throws UsageError when the capture was prepared without keypoints
  PoseNetStage(const Dataset& dataset, const Character& character, const PoseNetRunConfig& config);

  std::string name() const override { return "posenet"; }
  torch::nn::Module& model() override { return *network_; }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  std::vector<Picture> pictures() override;

  PoseNet& network() { return network_; }
  const PoseDofs& pose() const { return pose_; }
  /// What the network makes of a batch.
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
