#include "doppel/train/adapt.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "doppel/actor/stored_stage.h"
#include "doppel/actor/trained_pose.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/train/metrics.h"
#include "support/message_of.h"
#include "support/small_pose_run.h"

namespace doppel::adapt_test {
namespace {

using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

std::map<std::string, std::string> contents(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files[entry.path().string()] = read_file(entry.path());
  return files;
}

/// A studio run that was trained for a moment; one of its own cameras stands for the clip.
class Adapt : public support::SmallPoseRun {
 protected:
  static AdaptOptions options(const std::string& out, const std::string& config) {
    AdaptOptions options;
    options.run = *folder_ / "run";
    options.capture = *folder_ / "prepared";
    options.out = *folder_ / out;
    options.camera = "1";
    options.config = AdaptConfig::read(ConfigDocument::parse(config, "adapt.yaml"));
    return options;
  }
  static double keypoint_error(const nlohmann::ordered_json& report, const std::string& when) {
    return report.at("splits").at("tuned on, " + when).at("posenet").at("keypoint_error_px").get<double>();
  }
};

constexpr char kQuick[] =
    "{validation: 0.25, check_every: 10, "
    "posenet: {iterations: 60, learning_rate: 1e-3, batch_size: 6, keypoints: 0.01}, "
    "defnet: {iterations: 10, learning_rate: 1e-4, batch_size: 2}}";

TEST_F(Adapt, BringsTheNetworksNearerToTheClipAndLeavesTheStudioAlone) {
  const auto before = contents(*folder_ / "run");
  const nlohmann::ordered_json report = adapt(options("clip", kQuick));
  EXPECT_EQ(contents(*folder_ / "run"), before);
  EXPECT_LT(keypoint_error(report, "after"), keypoint_error(report, "before"));
  const auto held_out = [&](const std::string& when) {
    return report.at("splits").at("held out, " + when).at("posenet").at("keypoint_error_px").get<double>();
  };
  EXPECT_LT(held_out("after"), held_out("before"));
  EXPECT_EQ(report.at("protocol").at("frames").at("tuned on, after"), 6);
  const TrainedPose adapted = TrainedPose::load(*folder_ / "clip");
  EXPECT_TRUE(adapted.defnet);
  EXPECT_EQ(adapted.steps.at("posenet") % 10, 0);
  EXPECT_GT(adapted.steps.at("posenet"), 0);
  EXPECT_TRUE(fs::exists(*folder_ / "clip/report.html"));
  // A second call finds everything done.
  const auto done = contents(*folder_ / "clip");
  EXPECT_EQ(adapt(options("clip", kQuick)), report);
  EXPECT_EQ(contents(*folder_ / "clip"), done);
  // And refuses to take it for what would come of other settings.
  const auto complaint = [](const AdaptOptions& other) { return message_of<UsageError>([&] { adapt(other); }); };
  AdaptOptions other = options("clip", kQuick);
  other.config.validation = 0.5;
  EXPECT_THAT(complaint(other), HasSubstr("validation: 0.25 -> 0.5"));
  other = options("clip", kQuick);
  other.camera = "2";
  other.config.defnet.iterations = 0;
  EXPECT_THAT(complaint(other), AllOf(HasSubstr("camera: 1 -> 2"), HasSubstr("defnet.iterations: 10 -> 0")));
  fs::copy(*folder_ / "run", *folder_ / "same", fs::copy_options::recursive);
  other = options("clip", kQuick);
  other.run = *folder_ / "same";
  EXPECT_THAT(complaint(other), HasSubstr("run: "));
  EXPECT_EQ(contents(*folder_ / "clip"), done);
}

TEST_F(Adapt, TunesOnTheWholeClipAndKeepsTheLastStepAsTheThesisDoes) {
  const nlohmann::ordered_json report =
      adapt(options("whole",
                    "{check_every: 2, posenet: {iterations: 4, learning_rate: 1, batch_size: 3, keypoints: 0.01}, "
                    "defnet: {iterations: 0}}"));
  EXPECT_EQ(report.at("protocol").at("frames").at("tuned on, after"), 8);
  EXPECT_EQ(report.at("protocol").at("frames").at("held out, after"), 4) << "the test sequence of the capture";
  EXPECT_EQ(TrainedPose::load(*folder_ / "whole").steps.at("posenet"), 4);
}

TEST_F(Adapt, TunesDefNetWithTheWeightsThatAreStated) {
  const std::string common =
      "check_every: 2, posenet: {iterations: 0}, defnet: {iterations: 2, learning_rate: 1e-4, batch_size: 2";
  const auto weighted = [&](const std::string& out, const std::string& weights) {
    adapt(options(out, "{" + common + weights + "}}"));
    const std::vector<MetricsRecord> records = read_metrics(*folder_ / out / "defnet/metrics.jsonl");
    std::map<std::string, double> ratios;
    for (const auto& term : records.front().terms)
      if (term.raw > 0.0) ratios[term.name] = term.weighted / term.raw;
    return ratios;
  };
  const auto stated = weighted("stated", ", silhouette: 70, keypoints: 0.5, arap: 900"), studio = weighted("kept", "");
  EXPECT_NEAR(stated.at("silhouette"), 70.0, 1e-3);
  EXPECT_NEAR(stated.at("keypoints"), 0.5, 1e-5);
  EXPECT_NEAR(studio.at("silhouette"), 1000.0, 1e-2) << "that of the studio run";
  EXPECT_NEAR(studio.at("keypoints"), 0.05, 1e-6);
  const std::string settings = read_file(*folder_ / "stated/adapt.yaml"),
                    others = read_file(*folder_ / "kept/adapt.yaml");
  EXPECT_THAT(settings, AllOf(HasSubstr("silhouette: 70"), HasSubstr("arap: 900")));
  EXPECT_THAT(others, ::testing::Not(HasSubstr("arap")));
}

TEST_F(Adapt, RefusesToDrift) {
  const nlohmann::ordered_json report = adapt(options(
      "drifted",
      "{validation: 0.25, check_every: 2, posenet: {iterations: 4, learning_rate: 1, batch_size: 3, keypoints: 0.01}, "
      "defnet: {iterations: 0}}"));
  EXPECT_EQ(keypoint_error(report, "after"), keypoint_error(report, "before"));
  const TrainedPose studio = TrainedPose::load(*folder_ / "run"), kept = TrainedPose::load(*folder_ / "drifted");
  EXPECT_EQ(kept.steps.at("posenet"), 0);
  EXPECT_EQ(kept.digest(), studio.digest());
  // DefNet was not to be tuned: it is the studio's.
  EXPECT_EQ(weights_checksum(*kept.defnet), weights_checksum(*studio.defnet));
}

TEST_F(Adapt, FramesOfTheStudioAreNotThoseOfTheClip) {
  fs::copy(*folder_ / "run", *folder_ / "studio", fs::copy_options::recursive);
  for (const std::string kind : {"posenet", "defnet"}) {
    const fs::path config = *folder_ / "studio" / kind / "config.yaml";
    write_atomically(config,
                     ConfigDocument::load(config, {"data.frames=[0, 1]", "model.pretrained=gone.pth"}).resolved());
  }
  AdaptOptions wanted = options("all_frames", kQuick);
  wanted.run = *folder_ / "studio";
  adapt(wanted);
  const ConfigDocument tuned = ConfigDocument::load(*folder_ / "all_frames" / "posenet" / "config.yaml");
  EXPECT_TRUE(tuned.root().section("data").list<long>("frames").empty());
}

TEST_F(Adapt, Rejects) {
  const auto complaint = [](const AdaptOptions& wrong) { return message_of<UsageError>([&] { adapt(wrong); }); };
  AdaptOptions wrong = options("other", kQuick);
  wrong.out = *folder_ / "run";
  EXPECT_THAT(complaint(wrong), HasSubstr("another run"));
  wrong.out = *folder_ / "prepared";
  EXPECT_THAT(complaint(wrong), HasSubstr("not a run"));
  wrong = options("other", "held_out: 0.01");
  EXPECT_THAT(complaint(wrong), HasSubstr("cannot be held out"));
  wrong = options("other", kQuick);
  wrong.camera = "9";
  EXPECT_THAT(complaint(wrong), HasSubstr("there is no camera '9'"));
  EXPECT_THAT(message_of([] { AdaptConfig::read(ConfigDocument::parse("held_out: 1", "adapt.yaml")); }),
              HasSubstr("held_out"));
  EXPECT_THAT(
      message_of([] { AdaptConfig::read(ConfigDocument::parse("{held_out: 0.5, validation: 0.5}", "adapt.yaml")); }),
      HasSubstr("validation"));
}

TEST(AdaptConfigurations, ThatComeAlongAreReadable) {
  for (const std::string size : {"tiny", "small", "paper"}) {
    const fs::path file = fs::path(DOPPEL_SOURCE_DIR) / "configs" / size / "adapt.yaml";
    EXPECT_GT(AdaptConfig::read(ConfigDocument::load(file)).posenet.iterations, 0) << size;
  }
  const AdaptConfig paper =
      AdaptConfig::read(ConfigDocument::load(fs::path(DOPPEL_SOURCE_DIR) / "configs/paper/adapt.yaml"));
  EXPECT_EQ(paper.posenet.iterations, AdaptStage().iterations);
  EXPECT_EQ(paper.defnet.learning_rate, AdaptStage().learning_rate);
  EXPECT_EQ(paper.defnet.silhouette, 1000.0);
  EXPECT_EQ(paper.defnet.keypoints, 0.05);
  EXPECT_EQ(paper.defnet.arap, 1500.0);
}

}  // namespace
}  // namespace doppel::adapt_test
