/// Work in shards: `--shard i/n` of prepare, detect, track and evaluate, and `doppel merge`.

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "detect/networks/small_networks.h"
#include "doppel/core/atomic_file.h"
#include "run_program.h"
#include "shard_folder.h"
#include "support/blazepose_weights.h"
#include "support/comparable_files.h"
#include "support/hostile_files.h"
#include "support/temporary_folder.h"

namespace doppel::tools::shards_test {
namespace {

namespace fs = std::filesystem;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using Json = nlohmann::ordered_json;
using support::Files;
using support::files_in;

void expect_same_files(const Files& found, const Files& expected) {
  for (const auto& [name, content] : expected) {
    ASSERT_TRUE(found.count(name)) << name << " is missing";
    EXPECT_TRUE(found.at(name) == content) << name << " differs";
  }
  EXPECT_EQ(found.size(), expected.size());
}

/// A synthetic capture of two sequences.
class Shards : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    common_ = new TemporaryFolder;
    step("synth --preset tiny --frames 8 --test-frames 4 --out " + in_common("capture"));
    step("prepare --mask-size 48 --image-size 48 " + in_common("capture") + " --out " + in_common("prepared"));
  }
  static void TearDownTestSuite() {
    delete common_;
    common_ = nullptr;
  }
  static std::string in_common(const std::string& name) { return (*common_ / name).string(); }
  static std::string capture() { return in_common("capture"); }

  std::string at(const std::string& name) const { return (folder_ / name).string(); }
  std::string part(int i) const { return at("parts/" + std::to_string(i)); }

  /// The files of the whole work. Paths in them name the folder "out", which is free again afterwards.
  Files whole(const std::string& command) const {
    step(command + " --threads 1 --out " + at("out"));
    Files files = files_in(at("out"));
    fs::rename(at("out"), at("whole"));
    return files;
  }
  Files merged(const std::string& command, int count) const {
    for (int i = count - 1; i >= 0; --i)
      step(fmt::format("{} --shard {}/{} --threads 1 --out {}", command, i, count, part(i)));
    step("merge " + at("parts") + " --threads 1 --out " + at("out"));
    return files_in(at("out"));
  }
  void expect_merged_as_whole(const std::string& command, int count) const {
    const Files expected = whole(command);
    expect_same_files(merged(command, count), expected);
  }
  /// Two finished shards of a small preparation.
  void prepare_two() const {
    for (int i = 0; i < 2; ++i) step(prepare_part(i, 2) + " --out " + part(i));
  }
  std::string prepare_part(int i, int count) const {
    return fmt::format("prepare --mask-size 32 --image-size 32 --limit-frames 2 {} --shard {}/{}", capture(), i, count);
  }
  void change(int i, const std::function<void(Json&)>& edit) const {
    const fs::path path = fs::path(part(i)) / kShardFile;
    Json file = Json::parse(read_file(path));
    edit(file);
    write_atomically(path, file.dump());
  }

  TemporaryFolder folder_;
  static TemporaryFolder* common_;
};
TemporaryFolder* Shards::common_ = nullptr;

TEST_F(Shards, OfAPreparationBecomeTheSameBytes) {
  expect_merged_as_whole("prepare --mask-size 48 --image-size 48 " + capture(), 3);
  EXPECT_FALSE(fs::exists(part(0) + "/capture.yaml")) << "a part is no prepared capture";
  const Outcome outcome = step("merge " + part(2) + " " + part(0) + " " + part(1) + " --json --out " + at("again"));
  const Json summary = Json::parse(outcome.out);
  EXPECT_EQ(summary["command"], "prepare");
  EXPECT_EQ(summary["shards"], 3);
  EXPECT_EQ(summary["out"], at("again"));
}

TEST_F(Shards, OfASyntheticCaptureBecomeTheSameFiles) {
  const std::string command = "synth --preset tiny --cameras 2 --size 64 --frames 4 --test-frames 2";
  const Files expected = whole(command), found = merged(command, 3);
  EXPECT_FALSE(fs::exists(part(0) + "/capture.yaml")) << "a part is no capture";
  EXPECT_FALSE(fs::exists(part(0) + "/training/joints3d/001.csv")) << "the camera of another shard";
  for (const auto& [name, content] : expected) {
    ASSERT_TRUE(found.count(name)) << name << " is missing";
    // Encoders do not give the same bytes each time.
    const bool video = name.ends_with(".mp4") || name.ends_with(".mkv");
    EXPECT_TRUE(video ? !found.at(name).empty() : found.at(name) == content) << name << " differs";
  }
  EXPECT_EQ(found.size(), expected.size());
}

TEST_F(Shards, MayBeMoreThanUnits) {
  expect_merged_as_whole("track points " + capture(), 3);
  fs::remove_all(at("parts"));
  fs::remove_all(at("whole"));
  fs::remove_all(at("out"));
  expect_merged_as_whole("evaluate --capture " + in_common("prepared"), 3);
}

TEST_F(Shards, OfADetectionBecomeTheSameBytes) {
  using namespace test_networks;
  support::write_bytes(
      folder_ / "pose.onnx",
      centre_net(80, 60, {x_of(0), y_of(0), sum_of(0), x_of(1), y_of(1), sum_of(1), x_of(2), y_of(2), sum_of(2)},
                 {0, 0, 0, 1, 1, 1, 2, 2, 2}, {1, 3, 3}));
  support::write_bytes(folder_ / "mask.onnx", class_net(80, 60, 1, {20.0f}, {-6.0f}));
  support::write_bytes(folder_ / "map.yaml", "points: [blue, green, red]\nevery_point: true\n");
  support::write_bytes(folder_ / "net.yaml", "input: [80, 60]\nmask: {model: mask.onnx, input: [80, 60]}\n");
  expect_merged_as_whole("detect --masks --network " + at("pose.onnx") + " --config " + at("net.yaml") + " --layout " +
                             at("map.yaml") + " " + capture(),
                         3);
}

TEST_F(Shards, OfTracksBecomeTheSameBytes) {
  expect_merged_as_whole("track --surface --vertices --sheet-frames 1 --limit-frames 3 " + capture(), 2);
  fs::rename(at("out"), at("tracked"));
  fs::remove_all(at("parts"));
  fs::remove_all(at("whole"));
  expect_merged_as_whole(
      "evaluate --split all --frames 0,1,2 --tracked " + at("tracked") + " --capture " + in_common("prepared"), 2);
  fs::remove_all(at("parts"));
  fs::remove_all(at("whole"));
  fs::remove_all(at("out"));
  expect_merged_as_whole("track livecap --camera 0 --vertices --sheet-frames 0 --limit-frames 3 " + capture(), 2);
}

TEST_F(Shards, OfAnEvaluationBecomeThatOfTheRun) {
  step("train " DOPPEL_SOURCE_DIR
       "/configs/tiny/ddc.yaml --stages egnet --set egnet.train.iterations=3 --set capture=" +
       in_common("prepared") + " --out " + at("run"));
  const std::string evaluate = "evaluate --every 4 --split all --run " + at("run");
  const Files found = merged(evaluate, 2);
  expect_same_files(found, {{"evaluation.json", read_file(at("run/evaluation.json"))}});
  const std::string joined = read_file(at("run/evaluation.json"));
  fs::remove(at("run/evaluation.json"));
  step(evaluate + " --threads 1");
  EXPECT_EQ(read_file(at("run/evaluation.json")), joined);
}

TEST_F(Shards, ShowTheirPartInTheCommandsForm) {
  const Json prepared = Json::parse(step(prepare_part(0, 8) + " --json --out " + part(0)).out);
  EXPECT_EQ(prepared["cameras"].size(), 1u);
  const Json evaluated = Json::parse(
      step("evaluate --split all --shard 1/2 --json --capture " + in_common("prepared") + " --out " + part(1)).out);
  EXPECT_EQ(evaluated["splits"].size(), 1u);
  EXPECT_TRUE(evaluated["splits"]["test"].contains("skinning"));
}

TEST_F(Shards, AreFinishedWhenRunAgain) {
  prepare_two();
  change(1, [](Json& file) { file["finished"] = false; });
  EXPECT_THAT(complaint_about("merge " + at("parts") + " --out " + at("out")), HasSubstr("shard 1/2 is not finished"));
  step(prepare_part(1, 2) + " --out " + part(1));
  step("merge " + at("parts") + " --out " + at("out"));
}

TEST_F(Shards, HaveANumberBelowTheirCount) {
  for (const char* wrong : {"2/2", "0/0", "-1/2", "1", "a/b", "0/2x", "1/", "/2", "0/1/2", "0/999999999999", "' 0/2'"})
    EXPECT_THAT(complaint_about("prepare " + capture() + " --out " + part(0) + " --shard " + wrong),
                HasSubstr("--shard"))
        << wrong;
  EXPECT_FALSE(fs::exists(part(0)));
  EXPECT_EQ(run("train x.yaml --shard 0/2").code, 2) << "training is not cut into shards";
}

TEST_F(Shards, HaveAFolderEach) {
  EXPECT_THAT(complaint_about(prepare_part(0, 2)), HasSubstr("needs --out"));
  step(prepare_part(0, 2) + " --out " + part(0));
  EXPECT_THAT(complaint_about(prepare_part(1, 2) + " --out " + part(0)), HasSubstr("holds shard 0/2, not 1/2"));
  EXPECT_THAT(complaint_about(prepare_part(0, 3) + " --out " + part(0)),
              HasSubstr("one is of 2 shards, the other of 3"));
  EXPECT_THAT(complaint_about("prepare " + capture() + " --out " + part(0)), HasSubstr("holds a shard"));
  fs::create_directories(part(1));
  write_atomically(part(1) + "/notes.txt", "mine");
  EXPECT_THAT(complaint_about(prepare_part(1, 2) + " --out " + part(1)), HasSubstr("is not empty"));
}

TEST_F(Shards, AreMergedWhenAllAreThereOnce) {
  prepare_two();
  const std::string out = " --out " + at("out");
  EXPECT_THAT(complaint_about("merge " + part(0) + out), HasSubstr("1 of 2 shards are missing: 1"));
  EXPECT_THAT(complaint_about("merge " + part(0) + " " + part(0) + out), HasSubstr("are both shard 0/2"));
  EXPECT_THAT(complaint_about("merge " + at("nowhere") + out), HasSubstr("is no shard"));
  EXPECT_THAT(complaint_about("merge " + capture() + out), HasSubstr("is no shard"));
  EXPECT_THAT(complaint_about("merge " + at("parts") + " --out " + part(0)), HasSubstr("is not empty"));
  EXPECT_EQ(run("merge " + at("parts")).code, 2);
  EXPECT_FALSE(fs::exists(at("out")));
}

TEST_F(Shards, AreMergedWhenTheyBelongTogether) {
  prepare_two();
  const std::string merge = "merge " + at("parts") + " --out " + at("out");
  const Json good = Json::parse(read_file(part(1) + "/shard.json"));
  change(1, [](Json& file) { file["version"] = "0.0.1"; });
  EXPECT_THAT(complaint_about(merge), HasSubstr("doppel 0.0.1 the other"));
  change(1, [&](Json& file) { (file = good)["arguments"].push_back("--force"); });
  EXPECT_THAT(complaint_about(merge), AllOf(HasSubstr("the commands are"), HasSubstr("--force")));
  change(1, [&](Json& file) { (file = good)["inputs"][0] = "capture.yaml: 3 bytes"; });
  EXPECT_THAT(complaint_about(merge), AllOf(HasSubstr("read other files"), HasSubstr("capture.yaml: 3 bytes")));
  for (const int i : {0, 1})
    change(i, [&](Json& file) { file["inputs"] = good["inputs"], file["inputs"][0] = "capture.yaml: 3 bytes"; });
  EXPECT_THAT(complaint_about(merge), HasSubstr("the files as they are now"));
  EXPECT_FALSE(fs::exists(at("out")));
}

TEST_F(Shards, AreFilesOfThisProgram) {
  prepare_two();
  const std::string merge = "merge " + at("parts") + " --out " + at("out");
  for (const char* garbage : {"", "{}", "[1]"}) {
    write_atomically(part(1) + "/shard.json", garbage);
    EXPECT_THAT(complaint_about(merge), HasSubstr("cannot be read as a shard")) << garbage;
  }
  for (const char* format : {"9", "\"x\"", "1e300"}) {
    write_atomically(part(1) + "/shard.json", fmt::format("{{\"doppel_shard\": {}}}", format));
    EXPECT_THAT(complaint_about(merge), HasSubstr("has another format")) << format;
  }
  write_atomically(part(1) + "/shard.json", read_file(part(0) + "/shard.json"));
  for (const int i : {0, 1})
    change(i, [i](Json& file) {
      file["shard"] = fmt::format("{}/2", i);
      file["arguments"] = {"export", "--run", "x"};
    });
  EXPECT_THAT(complaint_about(merge), HasSubstr("the command is 'export'"));
  for (const int i : {0, 1}) change(i, [](Json& file) { file["arguments"] = {"prepare", "--no-such-option"}; });
  EXPECT_THAT(complaint_about(merge), HasSubstr("the arguments of the shard cannot be read"));
}

TEST_F(Shards, DamagedAreNamed) {
  prepare_two();
  fs::remove_all(part(1) + "/store");
  const Outcome outcome = run("merge " + at("parts") + " --out " + at("out"));
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr(part(1)));

  const std::string track = "track points " + capture();
  for (int i = 0; i < 2; ++i) step(fmt::format("{} --shard {}/2 --out {}", track, i, at("t" + std::to_string(i))));
  write_atomically(at("t1/track.json"), "{}");
  EXPECT_THAT(run("merge " + at("t0") + " " + at("t1") + " --out " + at("t")).err,
              HasSubstr("the sequence testing is missing"));
  write_atomically(at("t1/track.json"), "{");
  EXPECT_THAT(run("merge " + at("t0") + " " + at("t1") + " --out " + at("t")).err,
              HasSubstr("is not a file of a shard"));

  for (int i = 0; i < 2; ++i)
    step(fmt::format("evaluate --split all --shard {}/2 --capture {} --out {}", i, in_common("prepared"),
                     at("e" + std::to_string(i))));
  Json file = Json::parse(read_file(at("e1/shard.json")));
  file["results"] = nullptr;
  write_atomically(at("e1/shard.json"), file.dump());
  EXPECT_THAT(complaint_about("merge " + at("e0") + " " + at("e1") + " --out " + at("e")),
              HasSubstr("the rows of measurement 1 are missing"));
}

TEST_F(Shards, AreNotForWorkThatNeedsAllSequences) {
  const std::string shard = " --shard 0/2 --out " + part(0) + " " + capture();
  EXPECT_THAT(complaint_about("track --scale bones" + shard), HasSubstr("look at all sequences together"));
  EXPECT_THAT(complaint_about("track --set template_fit.frames=2" + shard), HasSubstr("fitted to all sequences"));
  EXPECT_THAT(complaint_about("track --shard 0/2 live --source film.mp4 " + capture()),
              HasSubstr("`doppel track live` is not cut into shards"));
  EXPECT_THAT(complaint_about("track livecap --camera 0 --preview x.mp4" + shard), HasSubstr("--preview"));
  std::string bare;
  std::istringstream lines(read_file(capture() + "/capture.yaml"));
  for (std::string line; std::getline(lines, line);)
    if (line.find("keypoints") == std::string::npos && line.find("joints3d") == std::string::npos) bare += line + "\n";
  write_atomically(capture() + "/bare.yaml", bare);
  EXPECT_THAT(complaint_about("track" + shard + "/bare.yaml"), HasSubstr("run `doppel detect` first"));
}

class RealShards : public support::BlazePoseTest {};

TEST_F(RealShards, OfMasksAreComparedBetweenAllCameras) {
  const TemporaryFolder folder;
  const auto at = [&](const std::string& name) { return (folder / name).string(); };
  step("synth --preset tiny --frames 8 --test-frames 4 --out " + at("capture"));
  const std::string detect = "detect --model lite --masks --threads 1 " + at("capture");
  step(detect + " --out " + at("out"));
  const Files expected = files_in(at("out"));
  fs::remove_all(at("out"));
  for (int i = 0; i < 2; ++i)
    step(fmt::format("{} --shard {}/2 --out {}", detect, i, at("parts/" + std::to_string(i))));
  step("merge --threads 1 " + at("parts") + " --out " + at("out"));
  expect_same_files(files_in(at("out")), expected);
}

}  // namespace
}  // namespace doppel::tools::shards_test
