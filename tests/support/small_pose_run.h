#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "doppel/data/prepare/prepare.h"
#include "doppel/synth/synth.h"
#include "doppel/train/stage_chain.h"
#include "support/temporary_folder.h"

namespace doppel::support {

/// The synthetic actor in eight frames and three cameras, prepared with keypoints. @return the prepared folder
inline std::filesystem::path prepare_small_actor(const std::filesystem::path& folder) {
  synth::SynthOptions actor = synth::SynthOptions::preset("tiny");
  actor.frames = 8;
  actor.test_frames = 4;
  actor.cameras = 3;
  actor.size = 128;
  synth::write_synthetic_capture(folder / "capture", actor);
  PrepareOptions prepare;
  prepare.out = folder / "prepared";
  prepare.image_size = 96;
  prepare.mask_size = 96;
  prepare_capture(read_capture(folder / "capture"), prepare);
  return prepare.out;
}

/// PoseNet and DefNet for a moment: 14 and 6 steps.
inline StageChain small_pose_chain(const std::filesystem::path& prepared,
                                   const std::vector<std::string>& overrides = {}) {
  static const std::string stages = R"(stage: deepcap
posenet:
  data: {batch_size: 4}
  model: {backbone: resnet18, input_size: 64}
  phases:
    - {iterations: 10, learning_rate: 1e-3, limits: 1}
    - {iterations: 4, learning_rate: 1e-4}
  train: {log_every: 2, checkpoint_every: 6}
defnet:
  data: {batch_size: 2, cameras_per_sample: 2}
  model: {backbone: resnet18, input_size: 64}
  train: {iterations: 6, learning_rate: 1e-4, log_every: 2, checkpoint_every: 3}
)";
  return StageChain::read(
      ConfigDocument::parse("capture: " + prepared.string() + "\n" + stages, "chain.yaml", overrides));
}

/// Tests on these networks: they are trained once for a suite, into `run` beside `capture` and `prepared`.
class SmallPoseRun : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    prepare_small_actor(folder_->path());
    summaries_ = train_stages(chain(), *folder_ / "run", {});
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static StageChain chain(const std::vector<std::string>& overrides = {}) {
    return small_pose_chain(*folder_ / "prepared", overrides);
  }
  inline static std::unique_ptr<TemporaryFolder> folder_;
  inline static std::vector<StageSummary> summaries_;
};

}  // namespace doppel::support
