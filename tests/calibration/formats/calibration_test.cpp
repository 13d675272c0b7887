#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <Eigen/Geometry>
#include <functional>
#include <random>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/temporary_folder.h"

namespace doppel::calibration_test {
namespace {

using support::replaced;
using support::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kSkeletool =
    "Skeletool Camera Calibration File V1.0\n"
    "name          7\n"
    "  sensor      10 10\n"
    "  size        640 480\n"
    "  animated    0\n"
    "  intrinsic   500 0 320 0  0 501 240 0  0 0 1 0  0 0 0 1\n"
    "  extrinsic   1 0 0 0  0 -1 0 900  0 0 -1 4000.5  0 0 0 1\n"
    "  radial      0\n"
    "name          moving\n"
    "  sensor      10 10\n"
    "  size        100 200\n"
    "  animated    1\n"
    "  frame       3\n"
    "  intrinsic   50 0 32 0  0 50 24 0  0 0 1 0  0 0 0 1\n"
    "  extrinsic   1 0 0 1  0 1 0 2  0 0 1 3  0 0 0 1\n"
    "  radial      0\n"
    "  frame       9\n"
    "  intrinsic   50 0 32 0  0 50 24 0  0 0 1 0  0 0 0 1\n"
    "  extrinsic   1 0 0 4  0 1 0 5  0 0 1 6  0 0 0 1\n"
    "  radial      0\n";

constexpr const char* kOpenCv =
    "%YAML:1.0\n"
    "---\n"
    "units: millimetres\n"
    "count: 2\n"
    "cam0:\n"
    "   width: 640\n"
    "   height: 480\n"
    "   K: !!opencv-matrix\n"
    "      rows: 3\n"
    "      cols: 3\n"
    "      dt: d\n"
    "      data: [ 500., 0., 320., 0., 501., 240., 0., 0., 1. ]\n"
    "   dist: [ -0.1, 0.2, 0.001, 0.002, 0.3 ]\n"
    "   R: !!opencv-matrix\n"
    "      rows: 3\n"
    "      cols: 3\n"
    "      dt: d\n"
    "      data: [ 1., 0., 0., 0., -1., 0., 0., 0., -1. ]\n"
    "   t: [ 0, 900, 4000.5 ]\n"
    "stage_left:\n"
    "   name: 12\n"
    "   width: 64\n"
    "   height: 48\n"
    "   K: [ 50, 0, 32, 0, 50, 24, 0, 0, 1 ]\n"
    "   R: [ 1, 0, 0, 0, 1, 0, 0, 0, 1 ]\n"
    "   t: [ 0, 0, 0 ]\n";

class CalibrationFile {
 public:
  std::vector<Camera> read(const std::string& text) {
    support::write_bytes(folder_ / "cameras.any", text);
    return read_calibration(folder_ / "cameras.any");
  }
  std::string refusal(const std::string& text) {
    return support::expect_rejects_or_reads("a changed file", [&] { read(text); });
  }
  std::vector<Camera> round_trip(const std::vector<Camera>& cameras, const std::string& extension) {
    write_calibration(folder_ / ("x" + extension), cameras);
    return read_calibration(folder_ / ("x" + extension));
  }
  const std::filesystem::path& folder() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
};

/// Cameras with as many digits as a double has.
std::vector<Camera> random_cameras(int count, bool distorted) {
  std::mt19937_64 generator(11);
  std::normal_distribution<double> normal;
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    Camera camera;
    camera.name = std::to_string(10 * i);
    camera.width = 1000 + i;
    camera.height = 800;
    camera.K << 900 + normal(generator), normal(generator), 500 + normal(generator), 0, 900 + normal(generator),
        400 + normal(generator), 0, 0, 1;
    camera.R = Eigen::Quaterniond(normal(generator), normal(generator), normal(generator), normal(generator))
                   .normalized()
                   .toRotationMatrix();
    camera.t = {normal(generator), 1e-7 * normal(generator), 4 + normal(generator)};
    if (distorted) {
      for (int k = 0; k < 8; ++k) camera.distortion[k] = 0.1 * normal(generator);
    }
    cameras.push_back(camera);
  }
  return cameras;
}

void expect_same(const std::vector<Camera>& found, const std::vector<Camera>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].name, expected[i].name);
    EXPECT_EQ(found[i].width, expected[i].width);
    EXPECT_EQ(found[i].height, expected[i].height);
    EXPECT_EQ(found[i].K, expected[i].K);
    EXPECT_EQ(found[i].R, expected[i].R);
    EXPECT_EQ(found[i].t, expected[i].t);
    EXPECT_EQ(found[i].lens, expected[i].lens);
    EXPECT_EQ(found[i].distortion, expected[i].distortion);
  }
}

TEST(CalibrationReference, SkeletoolMillimetresBecomeMetres) {
  CalibrationFile calibration;
  for (const std::string& text : {std::string(kSkeletool), support::with_crlf(kSkeletool)}) {
    const std::vector<Camera> cameras = calibration.read(text);
    ASSERT_EQ(cameras.size(), 3u);
    EXPECT_EQ(cameras[0].name, "7");
    EXPECT_EQ(cameras[0].width, 640);
    EXPECT_EQ(cameras[0].K(1, 1), 501);
    EXPECT_EQ(cameras[0].t, Eigen::Vector3d(0, 0.9, 4.0005));
    EXPECT_EQ(cameras[0].centre(), Eigen::Vector3d(0, 0.9, 4.0005));
    EXPECT_EQ(cameras[1].name, "moving@3");
    EXPECT_EQ(cameras[2].name, "moving@9");
    EXPECT_EQ(cameras[2].height, 200);
    EXPECT_EQ(cameras[2].t, Eigen::Vector3d(0.004, 0.005, 0.006));
  }
}

TEST(CalibrationReference, OpenCvUnitsNamesAndDistortion) {
  CalibrationFile calibration;
  for (const std::string& text : {std::string(kOpenCv), support::with_crlf(kOpenCv)}) {
    const std::vector<Camera> cameras = calibration.read(text);
    ASSERT_EQ(cameras.size(), 2u);
    EXPECT_EQ(cameras[0].name, "0");
    EXPECT_EQ(cameras[0].t, Eigen::Vector3d(0, 0.9, 4.0005));
    EXPECT_EQ(cameras[0].distortion, (std::array<double, 14>{-0.1, 0.2, 0.001, 0.002, 0.3}));
    EXPECT_EQ(cameras[1].name, "12");
  }
}

TEST(CalibrationReference, PixelCentresOfOtherProgramsAreMoved) {
  CalibrationFile calibration;
  const std::vector<Camera> cameras = calibration.read(replaced(kOpenCv, "count: 2", "pixel_centre: 0"));
  EXPECT_EQ(cameras[0].K(0, 2), 320.5);
  EXPECT_EQ(cameras[1].K(1, 2), 24.5);
}

TEST(CalibrationReference, RoundTripsToTheLastBit) {
  CalibrationFile calibration;
  expect_same(calibration.round_trip(random_cameras(50, false), ".calibration"), random_cameras(50, false));
  for (const char* extension : {".yml", ".yaml", ".json", ".xml"}) {
    expect_same(calibration.round_trip(random_cameras(5, true), extension), random_cameras(5, true));
  }
}

TEST(CalibrationReference, EveryLensOfOurOwnFileRoundTrips) {
  CalibrationFile calibration;
  std::vector<Camera> cameras = random_cameras(3, true);
  cameras[0].lens = Lens::fisheye;
  cameras[0].distortion = {0.1, -0.02, 0.003, 0.0004};
  cameras[1].lens = Lens::polynomial;
  cameras[1].distortion = {0.1, -0.02, 0.001, 0.002, 0.003, 0.0004};
  for (int k = 8; k < 14; ++k) cameras[2].distortion[k] = 0.01 * k;
  expect_same(calibration.round_trip(cameras, ".yml"), cameras);
}

TEST(CalibrationReference, AMovingCameraRoundTrips) {
  CalibrationFile calibration;
  const std::vector<Camera> cameras = calibration.read(kSkeletool);
  expect_same(calibration.round_trip(cameras, ".calibration"), cameras);
  expect_same(calibration.round_trip(cameras, ".yml"), cameras);
  const std::string text = read_file(calibration.folder() / "x.calibration");
  EXPECT_THAT(text, HasSubstr("name          moving\n"));
  EXPECT_EQ(text.find("moving@"), std::string::npos);
}

TEST(CalibrationReference, HardRoundingOfARotationIsMended) {
  CalibrationFile calibration;
  const std::vector<Camera> cameras =
      calibration.read(replaced(kSkeletool, "1 0 0 0  0 -1 0 900", "1 0.001 0 0  0 -1 0 900"));
  EXPECT_LT((cameras[0].R * cameras[0].R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
}

/// Four cameras around the axis `up` that look at the origin from 4 units away, slightly from above.
std::vector<Camera> ring(const Eigen::Vector3d& up) {
  const Eigen::Vector3d side = up.unitOrthogonal(), third = up.cross(side);
  std::vector<Camera> cameras;
  for (int i = 0; i < 4; ++i) {
    Camera camera;
    camera.name = std::to_string(i);
    camera.width = camera.height = 100;
    camera.K << 100, 0, 50, 0, 100, 50, 0, 0, 1;
    const double angle = 0.5 * M_PI * i;
    const Eigen::Vector3d centre = 4.0 * (std::cos(angle) * side + std::sin(angle) * third) + up;
    const Eigen::Vector3d forward = -centre.normalized(), right = forward.cross(up).normalized();
    camera.R << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    camera.t = -camera.R * centre;
    cameras.push_back(camera);
  }
  return cameras;
}

TEST(CalibrationReference, TheAxisThatIsUpInTheImagesIsFoundAndTurnedToY) {
  const TemporaryFolder folder;
  const std::pair<const char*, Eigen::Vector3d> axes[] = {{"+x", {1, 0, 0}},  {"-x", {-1, 0, 0}}, {"+y", {0, 1, 0}},
                                                          {"-y", {0, -1, 0}}, {"+z", {0, 0, 1}},  {"-z", {0, 0, -1}}};
  for (const auto& [name, up] : axes) {
    write_calibration(folder / "cameras.toml", ring(up), "toml");
    const Calibration found = load_calibration(folder / "cameras.toml");
    EXPECT_EQ(found.up, name);
    for (const Camera& camera : found.cameras) {
      EXPECT_NEAR(camera.centre().y(), 1.0, 1e-12) << name;
      EXPECT_GT(-camera.R(1, 1), 0.9) << name << ": +y must be up in the images";
      EXPECT_NEAR(camera.R.determinant(), 1.0, 1e-12) << name;
    }
    EXPECT_EQ(load_calibration(folder / "cameras.toml", {"", name}).notes.size(), found.notes.size() - 1);
  }
}

TEST(CalibrationReference, TheUnitIsFoundByTheExtentOrGiven) {
  const TemporaryFolder folder;
  std::vector<Camera> cameras = ring(Eigen::Vector3d::UnitY());
  for (Camera& camera : cameras) camera.t *= 1000.0;
  write_calibration(folder / "cameras.toml", cameras, "toml");
  Calibration found = load_calibration(folder / "cameras.toml");
  EXPECT_EQ(found.unit, "mm");
  EXPECT_NEAR(found.cameras[0].centre().norm(), std::sqrt(17.0), 1e-9);
  found = load_calibration(folder / "cameras.toml", {"cm", ""});
  EXPECT_EQ(found.unit, "cm");
  EXPECT_NEAR(found.cameras[0].centre().norm(), 10.0 * std::sqrt(17.0), 1e-9);
  EXPECT_THROW(load_calibration(folder / "cameras.toml", {"inch", ""}), UsageError);
  EXPECT_THROW(load_calibration(folder / "cameras.toml", {"", "z"}), UsageError);
}

TEST(CalibrationReference, EveryWriterIsReadBack) {
  const TemporaryFolder folder;
  for (const std::string& format : calibration_writers()) {
    SCOPED_TRACE(format);
    const std::vector<Camera> cameras = ring(Eigen::Vector3d::UnitY());
    write_calibration(folder / format, cameras, format);
    const Calibration found = load_calibration(folder / format);
    EXPECT_EQ(found.format, format);
    ASSERT_EQ(found.cameras.size(), cameras.size());
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      EXPECT_EQ(found.cameras[i].name, cameras[i].name);
      EXPECT_EQ(found.cameras[i].width, cameras[i].width);
      EXPECT_LT((found.cameras[i].projection() - cameras[i].projection()).cwiseAbs().maxCoeff(), 1e-6);
    }
    EXPECT_TRUE(is_calibration(folder / format));
  }
}

TEST(CalibrationReference, IntrinsicsAloneHaveNoPoses) {
  const TemporaryFolder folder;
  for (const char* name : {"x.yml", "x.json", "x.xml", "x.toml"}) {
    SCOPED_TRACE(name);
    const std::vector<Camera> cameras = random_cameras(name[2] == 't' ? 1 : 2, true);
    for (std::size_t count : {std::size_t{1}, cameras.size()}) {
      write_intrinsics(folder / name, {cameras.begin(), cameras.begin() + static_cast<std::ptrdiff_t>(count)});
      const Calibration found = load_calibration(folder / name);
      EXPECT_FALSE(found.has_poses);
      ASSERT_EQ(found.cameras.size(), count);
      EXPECT_NEAR(found.cameras[0].K(0, 2), cameras[0].K(0, 2), 1e-9);
      EXPECT_TRUE(found.cameras[0].R.isIdentity(0.0));
      EXPECT_THROW(read_calibration(folder / name), FileError);
    }
  }
  // A single camera whose pose is stated has it, even at the origin.
  std::vector<Camera> one = random_cameras(1, false);
  one[0].R.setIdentity();
  one[0].t.setZero();
  write_calibration(folder / "one.yml", one);
  EXPECT_TRUE(load_calibration(folder / "one.yml").has_poses);
}

TEST(CalibrationReference, OptionsOverrideWhatTheFileStatesWithANote) {
  const TemporaryFolder folder;
  write_calibration(folder / "cameras.yml", ring(Eigen::Vector3d::UnitY()));
  EXPECT_THAT(load_calibration(folder / "cameras.yml", {"m", "+y"}).notes, IsEmpty());
  const Calibration found = load_calibration(folder / "cameras.yml", {"cm", "+z"});
  EXPECT_EQ(found.unit, "cm");
  EXPECT_EQ(found.up, "+z");
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("states the unit m; the unit cm"), HasSubstr("states that +y is up")));
}

TEST(CalibrationReference, TargetsAreCheckedBeforeLongWork) {
  const TemporaryFolder folder;
  const auto check = [&](const char* name, const char* format, bool distortion) {
    check_calibration_target(folder / name, format, distortion);
  };
  EXPECT_THROW(check("y.txt", "", false), Error);
  EXPECT_THROW(check("y.yml", "qualisys", false), UsageError);
  EXPECT_THROW(check("y.calibration", "", true), UsageError);
  EXPECT_NO_THROW(check("y.calibration", "", false));
  EXPECT_NO_THROW(check("new/y.yml", "", true));
  std::filesystem::create_directories(folder / "full.yml/x");
  EXPECT_THROW(check("full.yml", "", true), UsageError);
  EXPECT_THROW(check("full.yml", "colmap", true), UsageError);
  EXPECT_FALSE(std::filesystem::exists(folder / "new"));
}

TEST(CalibrationReference, FoldersMayEndWithASlash) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "there");
  for (const char* name : {"new/", "there/"}) {
    write_calibration(folder / name, ring(Eigen::Vector3d::UnitY()), "colmap");
    EXPECT_EQ(load_calibration(folder / name).format, "colmap");
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 2) << "nothing is left over";
}

TEST(CalibrationRejects, WhatSkeletoolFilesGetWrong) {
  CalibrationFile calibration;
  const auto changed = [&](const char* from, const char* to) {
    return calibration.refusal(replaced(kSkeletool, from, to));
  };
  EXPECT_THAT(changed("V1.0", "V2.0"), HasSubstr(":1: reading a camera calibration: expected the header"));
  EXPECT_THAT(changed("radial      0", "radial      0.1"), HasSubstr("radial distortion"));
  EXPECT_THAT(changed("radial      0", "polynomial 1 2 3"), HasSubstr("fisheye"));
  EXPECT_THAT(changed("size        640 480", "size        -640 480"), HasSubstr(":4: "));
  EXPECT_THAT(changed("size        640 480", "sensor 1 1"), HasSubstr("no \"size\""));
  EXPECT_THAT(changed("1 0 0 0  0 -1 0 900", "1.5 0 0 0  0 -1 0 900"), HasSubstr("not a rotation"));
  EXPECT_THAT(changed("1 0 0 0  0 -1 0 900", "nan 0 0 0  0 -1 0 900"), HasSubstr("finite"));
  EXPECT_THAT(changed("1 0 0 0  0 -1 0 900", "-1 0 0 0  0 -1 0 900"), HasSubstr("mirrors"));
  EXPECT_THAT(changed("0 0 -1 4000.5", "0 0 -1"), HasSubstr("missing"));
}

TEST(CalibrationRejects, TwoCamerasOfOneName) {
  CalibrationFile calibration;
  const std::string still = std::string(kSkeletool).substr(0, std::string(kSkeletool).find("name          moving"));
  EXPECT_THAT(calibration.refusal(still + still.substr(still.find("name"))),
              HasSubstr("two cameras have the name \"7\""));
}

TEST(CalibrationRejects, NamesThatLeadOutOfAFolder) {
  const TemporaryFolder folder;
  const auto path = folder / "x.calibration";
  for (const char* name : {"../../../x", "/etc/x", "a/../../x", "a\\..\\x", "..", "x\x1b[2J"}) {
    write_atomically(path, replaced(kSkeletool, "name          7", std::string("name          ") + name));
    EXPECT_THROW(read_calibration(path), FileError) << name;
  }
  for (const char* name : {"a..b", "rig/left", "GX01-2@4k"}) {
    write_atomically(path, replaced(kSkeletool, "name          7", std::string("name          ") + name));
    EXPECT_EQ(read_calibration(path).at(0).name, name);
  }
}

TEST(CalibrationRejects, PipesWithoutWaitingForTheirWriter) {
  const TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "x.json").c_str(), 0600), 0);
  EXPECT_THROW(read_calibration(folder / "x.json"), FileError);
}

TEST(CalibrationRejects, WhatOpenCvFilesGetWrong) {
  CalibrationFile calibration;
  const auto changed = [&](const char* from, const char* to) {
    return calibration.refusal(replaced(kOpenCv, from, to));
  };
  EXPECT_THAT(changed("millimetres", "inches"), HasSubstr("\"inches\", allowed are metres"));
  EXPECT_THAT(changed("count: 2", "count: 3"), HasSubstr("promises 3 cameras, found 2"));
  EXPECT_THAT(changed("width: 640", "width: wide"), HasSubstr("cam0.width must be an integer"));
  EXPECT_THAT(changed("   t: [ 0, 900, 4000.5 ]\n", ""), HasSubstr("cam0.t must be a matrix, it is missing"));
  EXPECT_THAT(changed("t: [ 0, 900, 4000.5 ]", "t: [ 0, 900 ]"), HasSubstr("holds 2 numbers, expected 3"));
  EXPECT_THAT(changed("rows: 3", "rows: 1000000000"), HasSubstr("cam0.K has 9 numbers"));
  EXPECT_THAT(changed("-0.1, 0.2, 0.001, 0.002, 0.3", "1, 2, 3, 4, 5, 6, 7, 8, 9"),
              HasSubstr("has 9 coefficients of distortion; allowed are 0, 1, 2, 4, 5, 8, 12 or 14"));
  EXPECT_THAT(changed("500., 0., 320.", ".Nan, 0., 320."), HasSubstr("finite"));
  EXPECT_THAT(calibration.refusal("%YAML:1.0\n---\nunits: metres\n"), HasSubstr("holds no camera"));
}

TEST(CalibrationRejects, FilesOfNoKnownFormat) {
  CalibrationFile calibration;
  EXPECT_THAT(calibration.refusal("camera calibration of a program that nobody knows\n"),
              HasSubstr("none of the known formats"));
}

TEST(CalibrationRejects, ListsThatLieTooDeepInEachOther) {
  CalibrationFile calibration;
  for (const char* open : {"[", "{\"a\":", "- "}) {
    std::string text = "%YAML:1.0\n---\nK: ";
    for (int i = 0; i < 200000; ++i) text += open;
    EXPECT_THAT(calibration.refusal(text), HasSubstr("reading a camera calibration")) << open;
  }
}

TEST(CalibrationRejects, HostileFiles) {
  const TemporaryFolder folder;
  const auto read = [](const std::filesystem::path& path) { load_calibration(path); };
  support::expect_survives_hostile_files(folder / "a.calibration", kSkeletool, read);
  support::expect_survives_hostile_files(folder / "a.yml", kOpenCv, read);
}

TEST(CalibrationRejects, WhatCannotBeWritten) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_calibration(folder / "x.calibration", random_cameras(1, true)), Error) << "distortion";
  EXPECT_THROW(write_calibration(folder / "x.txt", random_cameras(1, false)), Error);
  EXPECT_THROW(write_calibration(folder / "x.yml", {}), Error);
  std::vector<Camera> cameras = random_cameras(1, false);
  cameras[0].name = "two words";
  EXPECT_THROW(write_calibration(folder / "x.calibration", cameras), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace doppel::calibration_test
