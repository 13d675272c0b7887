#include "doppel/track/shape/fit_character.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "doppel/core/error.h"
#include "doppel/rigging/body/body_shapes.h"
#include "doppel/rigging/body/measures.h"
#include "doppel/synth/synth.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::fit_character_test {
namespace {

namespace fs = std::filesystem;

/// A capture of a synthetic person of known lengths, whose character is not used.
class FilmedStranger : public ::testing::Test {
 protected:
  static constexpr std::uint64_t kPerson = 7;

  static void SetUpTestSuite() {
    folder_ = new support::TemporaryFolder();
    synth::SynthOptions options = synth::SynthOptions::preset("tiny");
    options.body = "random:" + std::to_string(kPerson);
    synth::write_synthetic_capture(*folder_ / "capture", options);
    model_ = new BodyModel(2000, 200);
  }
  static void TearDownTestSuite() {
    delete model_;
    delete folder_;
  }

  std::unique_ptr<Footage> footage() const {
    return Footage::open_for(family_.character(family_.mean()), *folder_ / "fitted.character", *folder_ / "capture",
                             FitCharacterOptions().config.fit.outline_pixels);
  }
  static FitCharacterOptions few_frames() {
    FitCharacterOptions options;
    options.frames = 6;
    // In images of 192 pixels, outlines are too coarse to count so much more than keypoints: with the default of .3,
    // the forearm becomes 34 mm too long.
    options.config.fit.keypoint_weight = 1.0;
    options.shape.rounds = 2;
    options.bends = 1;
    options.texture_size = 256;
    return options;
  }

  static support::TemporaryFolder* folder_;
  static BodyModel* model_;
  BodyShapes family_{"fitted", *model_};
};
support::TemporaryFolder* FilmedStranger::folder_ = nullptr;
BodyModel* FilmedStranger::model_ = nullptr;

TEST_F(FilmedStranger, BecomesACharacterOfHisLengthsAndShape) {
  const FittedCharacter fitted = fit_character(family_, *footage(), few_frames());
  const std::vector<double> ground_truth = random_measures(kPerson);
  for (const char* name : {"thigh_length", "shin_length", "upper_arm_length", "forearm_length", "shoulder_breadth"})
    EXPECT_NEAR(fitted.parameters[measure_index(name)], ground_truth[measure_index(name)], 0.03) << name;
  RecordProperty("keypoint_error_px", std::to_string(fitted.poses.keypoint_error));
  RecordProperty("overlap_of_measures", std::to_string(fitted.measured_overlap));
  RecordProperty("overlap", std::to_string(fitted.poses.overlap));
  EXPECT_LT(fitted.poses.keypoint_error, 6.0) << "about a pixel of these images";
  EXPECT_GT(fitted.poses.overlap, 0.85);
  EXPECT_GT(fitted.poses.overlap, fitted.measured_overlap) << "the outlines bend the surface";

  EXPECT_EQ(fitted.character.mesh.texture.cols, 256);
  EXPECT_GT(fitted.texture_coverage, 0.5);
  EXPECT_FALSE(fitted.sheet.empty());
  EXPECT_EQ(fitted.character.fingerprint(), family_.character(family_.mean()).fingerprint());
  const Character read = load_character(write_character(*folder_ / "written", fitted.character));
  EXPECT_EQ(read.fingerprint(), fitted.character.fingerprint());
}

TEST_F(FilmedStranger, AnUnknownSequenceIsRefused) {
  FitCharacterOptions options = few_frames();
  options.sequences = {"dance"};
  EXPECT_THAT(support::message_of<UsageError>([&] { fit_character(family_, *footage(), options); }),
              ::testing::HasSubstr("dance"));
}

}  // namespace
}  // namespace doppel::fit_character_test
