// The program as a user meets it: exit codes, messages, and the whole way from footage to an exported actor.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>

#include "doppel/core/atomic_file.h"
#include "doppel/core/npy.h"
#include "support/temporary_folder.h"

namespace doppel {
namespace {

using support::TemporaryFolder;

struct Outcome {
  int code;
  std::string out, err;
};

Outcome run(const std::string& arguments) {
  const TemporaryFolder folder;
  const std::string out = (folder / "out").string(), err = (folder / "err").string();
  const int status = std::system((DOPPEL_PROGRAM " " + arguments + " >'" + out + "' 2>'" + err + "'").c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(out), read_file(err)};
}

const std::vector<std::string> kCommands{"synth",    "character", "prepare", "train",
                                         "evaluate", "animate",   "export",  "info"};

TEST(ProgramReference, EveryCommandHelpsWithAnExample) {
  EXPECT_EQ(run("--help").code, 0);
  for (const std::string& command : kCommands) {
    const Outcome outcome = run(command + " --help");
    EXPECT_EQ(outcome.code, 0) << command;
    EXPECT_NE(outcome.out.find("doppel " + command), std::string::npos) << command << " --help shows no example:\n"
                                                                        << outcome.out;
    for (const char* option : {"--threads", "--json"})
      EXPECT_NE(outcome.out.find(option), std::string::npos) << command << " lacks " << option;
  }
}

TEST(ProgramRejects, WrongUseWithTwo) {
  EXPECT_EQ(run("").code, 2);
  EXPECT_EQ(run("dance").code, 2);
  for (const std::string& command : kCommands) EXPECT_EQ(run(command + " --no-such-option").code, 2) << command;
  EXPECT_EQ(run("info x --threads -3").code, 2);
  EXPECT_EQ(run("info x --log-level loud").code, 2);
}

TEST(ProgramRejects, MissingFilesWithOneAndTheirName) {
  for (const char* line : {"info missing.character", "animate --character missing.character --motion m.motion --out x",
                           "prepare missing_folder --out x", "train missing.yaml --out x", "evaluate --run missing_run",
                           "export --run missing_run --out x.pt"}) {
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, 1) << line << "\n" << outcome.err;
    EXPECT_NE(outcome.err.find("missing"), std::string::npos) << line << " does not name what is missing:\n"
                                                              << outcome.err;
  }
}

/// One tiny capture, prepared and trained once for all tests of this suite.
class ProgramRecovers : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    step("synth --preset tiny --out " + at("capture"));
    step("prepare " + at("capture") + " --out " + at("prepared"));
    step("train " DOPPEL_SOURCE "/configs/tiny/egnet.yaml --set capture=" + at("prepared") + " --out " + at("run"));
    step("export --run " + at("run") + " --out " + at("run/actor.pt"));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static void step(const std::string& line) {
    const Outcome outcome = run(line);
    ASSERT_EQ(outcome.code, 0) << "doppel " << line << "\n" << outcome.err;
  }
  static std::string at(const std::string& name) { return (*folder_ / name).string(); }

  static TemporaryFolder* folder_;
};
TemporaryFolder* ProgramRecovers::folder_ = nullptr;

TEST_F(ProgramRecovers, TheModelFitsUnseenMotionBetterThanSkinning) {
  const Outcome outcome = run("evaluate --run " + at("run") + " --split test --json");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const nlohmann::json result = nlohmann::json::parse(outcome.out);
  EXPECT_TRUE(result.contains("protocol"));
  const double skinning = result["splits"]["test"]["skinning"]["AMVIoU"],
               egnet = result["splits"]["test"]["egnet"]["AMVIoU"];
  EXPECT_GT(skinning, 0.5);
  EXPECT_GT(egnet, skinning + 0.002);
  EXPECT_LE(egnet, 1.0);
}

TEST_F(ProgramRecovers, TheRunFolderHoldsWhatItPromises) {
  for (const char* name : {"config.yaml", "metrics.jsonl", "report.html", "checkpoints/latest", "actor.pt"})
    EXPECT_TRUE(std::filesystem::exists(at(std::string("run/") + name))) << name;
  bool events = false;
  for (const auto& entry : std::filesystem::directory_iterator(at("run")))
    events |= entry.path().filename().string().rfind("events.out.tfevents.", 0) == 0;
  EXPECT_TRUE(events);
}

TEST_F(ProgramRecovers, TheActorAnimates) {
  const std::string motion = at("capture/testing/skeletoolToGTPose/poseAngles.motion");
  std::string character;
  for (const auto& entry : std::filesystem::directory_iterator(at("capture/character")))
    if (entry.path().extension() == ".character") character = entry.path().string();
  ASSERT_FALSE(character.empty());
  const std::string common = "animate --character " + character + " --motion " + motion;
  ASSERT_EQ(run(common + " --format npy --out " + at("skinned")).code, 0);
  const Outcome outcome =
      run(common + " --model " + at("run/actor.pt") + " --format npy,obj,mp4 --video-size 128 --out " + at("animated"));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const NpyArray skinned = read_npy(at("skinned/vertices.npy")), animated = read_npy(at("animated/vertices.npy"));
  EXPECT_EQ(skinned.shape, animated.shape);
  EXPECT_NE(skinned.bytes, animated.bytes);
  EXPECT_GT(std::filesystem::file_size(at("animated/turntable.mp4")), 1000u);
  EXPECT_TRUE(std::filesystem::exists(at("animated/frame_000000.obj")));
}

TEST_F(ProgramRecovers, AMistypedKeyIsNamedWithItsNeighbour) {
  const Outcome outcome = run("train " DOPPEL_SOURCE "/configs/tiny/egnet.yaml --set capture=" + at("prepared") +
                              " --set data.batch_sise=2 --out " + at("other"));
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("batch_size"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace doppel
