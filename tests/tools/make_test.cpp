// The chain of `doppel make`: what it runs, skips and refuses. docs/tasks/make.md, which a test runs, goes to the end.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "doppel/calibration/formats/read_calibration.h"
#include "run_program.h"
#include "support/temporary_folder.h"

namespace doppel::tools::make_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

/// Videos, keypoints and calibration of eight cameras around a moving character.
class MakeTool : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<support::TemporaryFolder>();
    ASSERT_EQ(run("synth --preset tiny --cameras 8 --out " + (*shared_ / "studio").string()).code, 0);
  }
  static void TearDownTestSuite() { shared_.reset(); }

  void SetUp() override {
    const fs::path studio = *shared_ / "studio";
    for (const char* sequence : {"training", "testing"})
      for (const char* kind : {"videos", "keypoints", "masks"})
        if (fs::exists(studio / sequence / kind)) copy(studio / sequence / kind, footage() / sequence / kind);
    copy(studio / "calibration" / "cameras.yml", footage() / "calibration" / "cameras.yml");
    copy(studio / "background", footage() / "background");
    copy(studio / "character", footage() / "character");
  }

  static void copy(const fs::path& from, const fs::path& to) {
    fs::create_directories(to.parent_path());
    fs::copy(from, to, fs::copy_options::recursive);
  }

  fs::path footage() const { return folder_ / "footage"; }

  Outcome make(const std::string& options, const std::string& out = "made") const {
    return run("make " + footage().string() + " --out " + (folder_ / out).string() + " --json " + options);
  }

  static std::vector<std::string> names_of(const json& report) {
    std::vector<std::string> names;
    for (const json& step : report["steps"]) names.push_back(step["name"]);
    return names;
  }

  fs::path calibration() const { return footage() / "calibration" / "cameras.yml"; }

  /// Turns each camera in its place, in one of four directions.
  void turn_cameras(double angle) const {
    std::vector<Camera> cameras = read_calibration(calibration());
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      const Eigen::AngleAxisd turn(c % 2 == 0 ? angle : -angle, Eigen::Vector3d::Unit(c / 2 % 2));
      cameras[c].R = turn * cameras[c].R;
      cameras[c].t = turn * cameras[c].t;
    }
    write_calibration(calibration(), cameras);
  }

  /// Exchanges the files of two cameras in every folder of the footage.
  void exchange(const std::string& a, const std::string& b) const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(footage() / "training"))
      if (entry.path().stem() == a) files.push_back(entry.path());
    ASSERT_FALSE(files.empty());
    for (const fs::path& file : files) {
      const fs::path other = file.parent_path() / (b + file.extension().string());
      fs::rename(file, folder_ / "kept");
      fs::rename(other, file);
      fs::rename(folder_ / "kept", other);
    }
  }

  support::TemporaryFolder folder_;
  static inline std::unique_ptr<support::TemporaryFolder> shared_;
};

TEST_F(MakeTool, GoesOnWhereItEnded) {
  const Outcome first = make("--stop-after doctor");
  ASSERT_EQ(first.code, 0) << first.err;
  const json report = json::parse(first.out);
  EXPECT_FALSE(report["complete"]);
  EXPECT_THAT(names_of(report), ElementsAre("describe", "doctor")) << "the footage has keypoints and masks";
  EXPECT_TRUE(fs::exists(folder_ / "made" / "report.html"));

  const Outcome second = make("--stop-after split");
  ASSERT_EQ(second.code, 0) << second.err;
  const json further = json::parse(second.out);
  EXPECT_THAT(names_of(further), ElementsAre("describe", "doctor", "calibrate", "split"));
  EXPECT_THAT(second.err, HasSubstr("the calibration stays as it is")) << "it is exact";
  EXPECT_EQ(further["steps"][1], report["steps"][1]) << "a step that has ended is not run again";
  EXPECT_THAT(second.err, Not(HasSubstr("doppel doctor")));
}

TEST_F(MakeTool, AdjustsCamerasOfWhichNoneStandsOut) {
  turn_cameras(0.005);
  const Outcome made = make("--stop-after calibrate");
  ASSERT_EQ(made.code, 0) << made.err;
  EXPECT_THAT(names_of(json::parse(made.out)),
              ElementsAre("describe", "doctor", "calibrate", "calibrated", "doctor_calibrated"));
  EXPECT_THAT(made.err, HasSubstr("the adjusted cameras are used"));
}

TEST_F(MakeTool, RefusesAFolderThatWasMadeFromSomethingElse) {
  ASSERT_EQ(make("--stop-after describe").code, 0);
  const Outcome other = make("--minutes 7");
  EXPECT_EQ(other.code, 2);
  EXPECT_THAT(other.err, HasSubstr("was made from other footage or with other options"));
}

TEST_F(MakeTool, RefusesTheFolderOfTheFootage) {
  const Outcome refused = run("make " + footage().string() + " --out " + footage().string() + "/.");
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("is the folder of the footage"));
}

TEST_F(MakeTool, StopsOnAFaultyRecordingWithItsName) {
  exchange("000", "003");
  const Outcome stopped = make("--stop-after split");
  EXPECT_EQ(stopped.code, 1);
  EXPECT_EQ(stopped.out, "");
  EXPECT_THAT(stopped.err, AllOf(HasSubstr("swapped_cameras"), HasSubstr("the recording is faulty")));
  const Outcome forced = make("--stop-after split --keep-going");
  EXPECT_EQ(forced.code, 0) << forced.err;
}

TEST_F(MakeTool, NamesWhatAnIncompleteFolderLacks) {
  fs::remove_all(footage() / "calibration");
  fs::remove_all(footage() / "character");
  const Outcome refused = make("");
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("missing: "), HasSubstr("calibration"), Not(HasSubstr("no character"))));
}

}  // namespace
}  // namespace doppel::tools::make_test
