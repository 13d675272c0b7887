#include <gmock/gmock.h>

#include <filesystem>

#include "doppel/core/atomic_file.h"
#include "doppel/data/capture/find_capture.h"
#include "run_program.h"
#include "support/temporary_folder.h"

namespace doppel::tools::capture_amend_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A capture with two cameras, of which it uses one; no footage is there.
class CaptureAmend : public ::testing::Test {
 protected:
  CaptureAmend() {
    fs::create_directories(folder_.path() / "footage");
    write_cameras("footage/cameras.yml", {"a", "b"});
    write_atomically(folder_.path() / "footage/capture.yaml",
                     "doppel_capture: 1\nname: anna\ncalibration: cameras.yml\ncameras: [a]\n"
                     "sequences:\n  - {name: s, split: train, videos: '{camera}.mp4'}\n");
  }
  void write_cameras(const std::string& file, const std::vector<std::string>& names) const {
    std::string cameras = "%YAML:1.0\n---\n";
    for (const std::string& name : names)
      cameras += name + ":\n   name: \"" + name +
                 "\"\n   width: 16\n   height: 16\n   K: [ 20, 0, 8, 0, 20, 8, 0, 0, 1 ]\n   dist: [ 0, 0, 0, 0 ]\n"
                 "   R: [ 1, 0, 0, 0, -1, 0, 0, 0, -1 ]\n   t: [ " +
                 std::to_string(name[0] - 'a') + ", 1, 4 ]\n";
    write_atomically(folder_.path() / file, cameras);
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  Outcome amend(const std::string& options) const {
    return run("capture amend " + path("footage") + " --out " + path("amended.yaml") + " " + options);
  }
  support::TemporaryFolder folder_;
};

TEST_F(CaptureAmend, ChoosesCameras) {
  ASSERT_EQ(amend("").code, 0);
  EXPECT_THAT(find_capture(path("amended.yaml")).cameras, ElementsAre("a"));
  ASSERT_EQ(amend("--cameras b,a").code, 0);
  EXPECT_THAT(find_capture(path("amended.yaml")).cameras, ElementsAre("b", "a"));
  ASSERT_EQ(amend("--cameras all").code, 0);
  EXPECT_THAT(find_capture(path("amended.yaml")).cameras, IsEmpty());
}

TEST_F(CaptureAmend, AnotherCalibrationHasUnitAndAxisOfItsOwn) {
  std::string text = read_file(path("footage/capture.yaml"));
  write_atomically(path("footage/capture.yaml"), text + "unit: mm\nup: '+z'\n");
  ASSERT_EQ(amend("").code, 0);
  EXPECT_EQ(find_capture(path("amended.yaml")).calibration_options.up, "+z");
  ASSERT_EQ(amend("--calibration " + path("footage/cameras.yml")).code, 0);
  EXPECT_EQ(find_capture(path("amended.yaml")).calibration_options.up, "");
  EXPECT_EQ(find_capture(path("amended.yaml")).calibration_options.unit, "");
}

TEST_F(CaptureAmend, CamerasKeepTheirFootageInAnotherOrder) {
  write_cameras("turned.yml", {"b", "a"});
  ASSERT_EQ(amend("--calibration " + path("turned.yml")).code, 0);
  const CameraPaths videos = read_capture(path("amended.yaml")).sequences.at(0).videos;
  EXPECT_EQ(videos.of("a"), "0.mp4");
  EXPECT_EQ(videos.of("b"), "1.mp4");
  write_cameras("others.yml", {"c", "d"});
  const Outcome outcome = amend("--calibration " + path("others.yml"));
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("none of the cameras"));
}

TEST_F(CaptureAmend, RefusesAnUnknownCamera) {
  const Outcome outcome = amend("--cameras a,c");
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("c"));
  EXPECT_FALSE(fs::exists(path("amended.yaml")));
}

}  // namespace
}  // namespace doppel::tools::capture_amend_test
