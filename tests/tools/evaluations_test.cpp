/// `doppel evaluate` of tracked sequences and of skinning, `doppel compare`, and options of `doppel synth`.

#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/npy.h"
#include "run_program.h"
#include "support/temporary_folder.h"

namespace doppel::tools::evaluations_test {
namespace {

namespace fs = std::filesystem;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::ordered_json;

/// Folders with an evaluation.json.
class Compare : public ::testing::Test {
 protected:
  std::string at(const std::string& name) const { return (folder_ / name).string(); }
  /// The evaluation of a method on the test split.
  static Json evaluation(const Json& row) {
    Json json;
    json["protocol"] = {{"capture", "anna"},
                        {"every", 1},
                        {"frames", {{"test", 60}}},
                        {"cameras", {"0", "1"}},
                        {"resolution", {{"0", {512, 512}}, {"1", {512, 512}}}}};
    json["splits"]["test"]["method"] = row;
    return json;
  }
  void write(const std::string& run, const Json& json) const {
    write_atomically(folder_ / run / "evaluation.json", json.dump());
  }

  TemporaryFolder folder_;
};

TEST_F(Compare, RunsEvaluatedInTheSameWayAreOneTable) {
  write("a", evaluation({{"AMVIoU", 0.9}}));
  write("b", evaluation({{"AMVIoU", 0.95}}));
  EXPECT_EQ(step("compare " + at("a") + " " + at("b")).out,
            "| run | method | AMVIoU |\n|---|---|---:|\n| a | method | 0.9000 |\n| b | method | 0.9500 |\n");
  EXPECT_EQ(Json::parse(step("compare --json " + at("a") + " " + at("b")).out),
            Json({{"a", {{"method", {{"AMVIoU", 0.9}}}}}, {"b", {{"method", {{"AMVIoU", 0.95}}}}}}));
}

TEST_F(Compare, ShowsTheFiguresOfPosesSurfacesAndImages) {
  write("a", evaluation({{"RVIoU", 0.8},
                         {"SVIoU", 0.9},
                         {"hand_IoU", 0.5},
                         {"outside", 0.015},
                         {"surface_distance_mm", 4.0},
                         {"seen_distance_mm", 3.0},
                         {"3DPCK", 92.5},
                         {"AUC", 60.0},
                         {"MPJPE_mm", 70.0},
                         {"GLE_mm", 50.0},
                         {"keypoint_error_px", 6.5},
                         {"sharpness", 0.7},
                         {"filmed", {{"MSE", 21.0}}}}));
  const std::string table = step("compare " + at("a")).out;
  EXPECT_THAT(table,
              HasSubstr("| RVIoU | SVIoU | hand_IoU | outside % | surface_distance_mm | seen_distance_mm | 3DPCK "
                        "| AUC | MPJPE_mm | GLE_mm | keypoint_error_px | sharpness | filmed_MSE |"));
  EXPECT_THAT(table,
              HasSubstr("| 0.8000 | 0.9000 | 0.500 | 1.50 | 4.00 | 3.00 | 92.5 | 60.0 | 70.0 | 50.0 | 6.5 | 0.700 "
                        "| 21.00 |"));
}

TEST_F(Compare, SaysWhichRunsWereEvaluatedInAnotherWay) {
  write("a", evaluation({{"AMVIoU", 0.9}}));
  Json other = evaluation({{"AMVIoU", 0.95}});
  other["protocol"]["every"] = 4;
  other["protocol"]["frames"]["test"] = 15;
  other["protocol"]["cameras"] = Json::array({"1"});
  other["protocol"]["only_frames"] = Json::array({3, 4});
  other["protocol"]["pictures"]["crop"] = 256;  // the other run has no images to compare
  write("b", other);
  const std::string table = step("compare " + at("a") + " " + at("b")).out;
  EXPECT_THAT(table,
              AllOf(HasSubstr("- every: a 1; b 4\n"), HasSubstr("- frames: a 60; b 15\n"),
                    HasSubstr("- cameras: a [\"0\",\"1\"]; b [\"1\"]\n"), HasSubstr("- only_frames: a none; b [3,4]\n"),
                    Not(HasSubstr("crop")), Not(HasSubstr("- capture"))));
  const Json json = Json::parse(step("compare --json " + at("a") + " " + at("b")).out);
  EXPECT_EQ(json["b"]["method"]["AMVIoU"], 0.95);
  EXPECT_EQ(json["protocol_differences"]["every"], Json({{"a", 1}, {"b", 4}}));
  EXPECT_FALSE(json["protocol_differences"].contains("capture"));
}

TEST_F(Compare, AFigureThatIsNoNumberIsADash) {
  write("a", evaluation({{"AMVIoU", 0.9}, {"MPJPE_mm", nullptr}}));
  EXPECT_THAT(step("compare " + at("a")).out, HasSubstr("| a | method | 0.9000 | - |"));
}

TEST_F(Compare, NamesTheSplitsThatAreThere) {
  write("a", evaluation({{"AMVIoU", 0.9}}));
  EXPECT_THAT(complaint_about("compare --split train " + at("a")), HasSubstr("has no train split; give --split test"));
  for (const char* word : {"all", "tset"})
    EXPECT_THAT(complaint_about("compare --split " + std::string(word) + " " + at("a")),
                AllOf(HasSubstr(word), HasSubstr("train, validation and test"), Not(HasSubstr("doppel evaluate"))));
}

/// A prepared synthetic capture.
class Evaluate : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    step("synth --preset tiny --frames 8 --test-frames 4 --cameras 2 --size 64 --out " + at("capture"));
    step("prepare --mask-size 32 --image-size 32 " + at("capture") + " --out " + at("prepared"));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static std::string at(const std::string& name) { return (*folder_ / name).string(); }
  static std::string evaluate(const std::string& options) {
    return "evaluate --capture " + at("prepared") + " " + options;
  }

  static TemporaryFolder* folder_;
};
TemporaryFolder* Evaluate::folder_ = nullptr;

TEST_F(Evaluate, NamesTheSplits) {
  EXPECT_THAT(complaint_about(evaluate("--split dev")), HasSubstr("train, validation, test or all"));
  EXPECT_THAT(complaint_about(evaluate("--split validation")), HasSubstr("it has train, test"));
}

TEST_F(Evaluate, AFrameOfOneSplitMayBeAskedForInAll) {
  const Json json = Json::parse(step(evaluate("--split all --frames 6 --json")).out);  // testing has 4 frames
  EXPECT_EQ(json["protocol"]["frames"], Json({{"train", 1}}));
  EXPECT_THAT(complaint_about(evaluate("--split all --frames 6,99")), HasSubstr("frame 99"));
}

TEST_F(Evaluate, RefusesOptionsThatExcludeEachOther) {
  EXPECT_THAT(complaint_about(evaluate("--frames 1 --every 2")), AllOf(HasSubstr("--every"), HasSubstr("--frames")));
  EXPECT_THAT(complaint_about(evaluate("--cameras 0,0")), HasSubstr("twice"));
}

// A character of another resolution, as of `doppel character` beside that of the ground truth.
TEST_F(Evaluate, GroundTruthOfAnotherCharacterIsLeftOut) {
  const fs::path file = at("capture/ground_truth/testing/vertices.npy");
  const std::string before = read_file(file);
  const std::vector<float> few(4 * 7 * 3, 0.0f);
  write_npy(file, few.data(), {4, 7, 3});
  const Outcome outcome = step(evaluate("--split all --every 3 --json"));
  const Outcome table = step(evaluate("--split test --every 3"));
  const Outcome train = step(evaluate("--split train --every 3 --json"));
  write_atomically(file, before);
  const Json json = Json::parse(outcome.out);
  EXPECT_THAT(outcome.err, HasSubstr("surfaces of 7 vertices"));
  EXPECT_THAT(json["protocol"]["left_out"]["test"].get<std::string>(), HasSubstr("vertex error"));
  EXPECT_FALSE(json["splits"]["test"]["skinning"].contains("vertex_error_mm"));
  EXPECT_GT(json["splits"]["test"]["skinning"]["AMVIoU"].get<double>(), 0.5);
  EXPECT_THAT(table.out, HasSubstr("left out: vertex error"));
  EXPECT_TRUE(Json::parse(train.out)["splits"]["train"]["skinning"].contains("vertex_error_mm"));
}

TEST_F(Evaluate, AFolderThatCannotBeWrittenIsSaidBeforeAnythingIsMeasured) {
  fs::create_directories(at("taken/evaluation.json"));
  const Outcome outcome = run(evaluate("--out " + at("taken")));
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("evaluation.json"), Not(HasSubstr("skinning"))));
  EXPECT_EQ(outcome.out, "");
}

TEST_F(Evaluate, ATrackedFolderOfAnotherCaptureIsSaid) {
  step("track --vertices --sheet-frames 0 --limit-frames 2 " + at("capture") + " --out " + at("tracked"));
  const std::string options = "--frames 0,1 --split test --tracked ";
  EXPECT_THAT(step(evaluate(options + at("tracked"))).err, Not(HasSubstr("was tracked, and")));
  const std::string text = read_file(at("tracked/capture.yaml"));
  const std::size_t name = text.find("name: capture");
  ASSERT_NE(name, std::string::npos) << text;
  write_atomically(at("tracked/capture.yaml"), text.substr(0, name) + "name: berta" + text.substr(name + 13));
  EXPECT_THAT(step(evaluate(options + at("tracked"))).err, AllOf(HasSubstr("berta in"), HasSubstr("was tracked, and")));
}

TEST(SynthCommand, RefusesSeedsThatAreNoNumbersOfItsRange) {
  const TemporaryFolder folder;
  const std::string synth = "synth --preset tiny --out " + (folder / "x").string() + " --seed ";
  for (const char* seed : {"-1", "18446744073709551616", "1.5", "one"})
    EXPECT_THAT(complaint_about(synth + seed), AllOf(HasSubstr(seed), HasSubstr("0 to 18446744073709551615")));
  EXPECT_FALSE(fs::exists(folder / "x"));
}

}  // namespace
}  // namespace doppel::tools::evaluations_test
