// Every preset of configs/paper takes steps: the losses, networks and keys of the thesis work together. Steps, batches,
// rays, images and textures are fewer or smaller here, nothing else.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "doppel/core/atomic_file.h"
#include "run_program.h"
#include "support/temporary_folder.h"

namespace doppel::tools {
namespace {

namespace fs = std::filesystem;
using support::TemporaryFolder;

constexpr int kSteps = 2;

/// One tiny capture for all presets.
class PaperPresets : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    step("synth --preset tiny --out " + at("capture"));
    step("prepare --limit-frames 8 " + at("capture") + " --out " + at("prepared"));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static std::string at(const std::string& name) { return (*folder_ / name).string(); }
  static std::string preset(const std::string& name) { return DOPPEL_SOURCE_DIR "/configs/paper/" + name + ".yaml"; }

  /// Trains a preset into the folder of the same name. @param changes KEY=VALUE ...
  static void train(const std::string& name, const std::vector<std::string>& changes) {
    std::string line = "train " + preset(name) + " --out " + at(name) + " --set capture=" + at("prepared");
    for (const std::string& change : changes) line += " --set " + change;
    step(line);
  }
  /// The losses of a stage in metrics.jsonl are finite, and its last step is the last of the configuration.
  static void expect_steps(const std::string& stage, int steps) {
    std::istringstream lines(read_file(at(stage + "/metrics.jsonl")));
    int last = 0;
    for (std::string line; std::getline(lines, line);) {
      const nlohmann::json row = nlohmann::json::parse(line);
      if (!row.contains("loss")) continue;
      EXPECT_TRUE(row["loss"].is_number() && std::isfinite(row["loss"].get<double>())) << stage << ": " << line;
      last = row["step"];
    }
    EXPECT_EQ(last, steps) << stage;
  }

  static TemporaryFolder* folder_;
};
TemporaryFolder* PaperPresets::folder_ = nullptr;

TEST_F(PaperPresets, DdcAndBothRadianceFieldsOnIt) {
  std::vector<std::string> changes{"egnet.data.batch_size=4",    "lighting.data.image_size=64",
                                   "deltanet.data.batch_size=2", "deltanet.data.image_size=64",
                                   "texnet.data.batch_size=2",   "texnet.data.image_size=64",
                                   "texnet.model.size=64"};
  for (const char* stage : {"egnet", "lighting", "deltanet", "texnet"}) {
    changes.push_back(std::string(stage) + ".train.iterations=" + std::to_string(kSteps));
    changes.push_back(std::string(stage) + ".train.log_every=1");
  }
  train("ddc", changes);
  for (const char* stage : {"egnet", "lighting", "deltanet", "texnet"})
    expect_steps(std::string("ddc/") + stage, kSteps);

  train("hybrid", {"ddc=" + at("ddc"), "radiance.data.image_size=64", "radiance.rays.count=100",
                   "radiance.rounds.0.field=1", "radiance.rounds.0.refine=1", "radiance.rounds.1.field=1",
                   "radiance.rounds.1.refine=1", "radiance.train.log_every=1"});
  expect_steps("hybrid/radiance", 4);

  train("nerf", {"ddc=" + at("ddc"), "nerf.data.frames=[3]", "nerf.data.image_size=64", "nerf.rays.count=32",
                 "nerf.train.iterations=" + std::to_string(kSteps), "nerf.train.log_every=1"});
  expect_steps("nerf/nerf", kSteps);
}

TEST_F(PaperPresets, DeepCapAndItsAdaptation) {
  train("deepcap", {"posenet.data.batch_size=2", "posenet.model.input_size=64", "defnet.model.input_size=64",
                    "posenet.phases.0.iterations=1", "posenet.phases.1.iterations=1", "posenet.phases.2.iterations=1",
                    "posenet.train.log_every=1", "defnet.data.batch_size=2", "defnet.train.iterations=2",
                    "defnet.train.log_every=1"});
  expect_steps("deepcap/posenet", 3);
  expect_steps("deepcap/defnet", 2);

  step("adapt --run " + at("deepcap") + " --capture " + at("prepared") + " --out " + at("adapted") + " --config " +
       preset("adapt") +
       " --set posenet.iterations=2 --set posenet.batch_size=2 --set defnet.iterations=2 --set defnet.batch_size=2");
  EXPECT_TRUE(fs::exists(at("adapted/adapt.json")));
}

TEST_F(PaperPresets, LiveCap) {
  step("track livecap " + at("capture") + " --camera 0 --limit-frames 4 --config " + preset("livecap") + " --out " +
       at("tracked"));
  const nlohmann::json track = nlohmann::json::parse(read_file(at("tracked/track.json")));
  EXPECT_FALSE(track.empty());
}

}  // namespace
}  // namespace doppel::tools
