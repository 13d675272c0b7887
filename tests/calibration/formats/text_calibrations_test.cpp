/// Calibrations in YAML, FileStorage and TOML files: EasyMocap, OpenCV's programs, ROS, Kalibr, aniposelib and its
/// relatives, Caliscope.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>

#include "calibration/formats/source_of.h"
#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::text_calibrations_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using support::names_of;
using support::replaced;
using support::source_of;
using support::TemporaryFolder;
using support::write_bytes;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Format = std::unique_ptr<CalibrationFormat>;

constexpr double kExact = 1e-12;

Calibration read(const Format& format, const fs::path& path) { return format->read(source_of(path)); }

std::string refusal(const Format& format, const fs::path& path) {
  return message_of<FileError>([&] { read(format, path); });
}

/// Files of one test.
class Files {
 public:
  fs::path write(const std::string& name, const std::string& text) {
    write_bytes(folder_ / name, text);
    return folder_ / name;
  }
  fs::path path(const std::string& name = "") const { return name.empty() ? folder_.path() : folder_ / name; }

 private:
  TemporaryFolder folder_;
};

/// The pixel of a point in camera coordinates by OpenCV's documented formulas, in Doppel's convention of pixel centres.
/// @param K fx fy cx cy of the file; @param k k1 k2 p1 p2 k3
Eigen::Vector2d brown_pixel(const std::array<double, 4>& K, const std::array<double, 5>& k, const Eigen::Vector3d& p) {
  const double x = p.x() / p.z(), y = p.y() / p.z(), r2 = x * x + y * y;
  const double radial = 1 + k[0] * r2 + k[1] * std::pow(r2, 2) + k[4] * std::pow(r2, 3);
  const double u = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
  const double v = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
  return {K[0] * u + K[2] + 0.5, K[1] * v + K[3] + 0.5};
}

Eigen::Vector2d fisheye_pixel(const std::array<double, 4>& K, const std::array<double, 4>& k,
                              const Eigen::Vector3d& p) {
  const double r = std::hypot(p.x(), p.y()) / p.z(), theta = std::atan(r);
  const double bent = theta + k[0] * std::pow(theta, 3) + k[1] * std::pow(theta, 5) + k[2] * std::pow(theta, 7) +
                      k[3] * std::pow(theta, 9);
  return {K[0] * bent / r * p.x() / p.z() + K[2] + 0.5, K[1] * bent / r * p.y() / p.z() + K[3] + 0.5};
}

void expect_near(const Eigen::Vector2d& found, const Eigen::Vector2d& expected) {
  EXPECT_NEAR(found.x(), expected.x(), 1e-9);
  EXPECT_NEAR(found.y(), expected.y(), 1e-9);
}

/// Two cameras with all that a format of OpenCV's lens can hold: skew, 5 coefficients, any rotation.
std::vector<Camera> made_cameras() {
  std::vector<Camera> cameras(2);
  for (int i = 0; i < 2; ++i) {
    Camera& camera = cameras[static_cast<std::size_t>(i)];
    camera.name = i == 0 ? "left_1" : "right-2";
    camera.width = 1280 + i;
    camera.height = 720;
    camera.K << 1001.25 / 3, 0.125, 640.1 + i, 0, 999.75, 361.7 / 3, 0, 0, 1;
    camera.R = Eigen::AngleAxisd(2.1 + i, Eigen::Vector3d(0.3, -0.5, 0.7).normalized()).toRotationMatrix();
    camera.t = Eigen::Vector3d(1.0 / 3, -2e-7, 4 + i);
    camera.distortion = {-0.1 / 3, 0.02, 1e-5, -3e-17, 0.004 * i};
  }
  return cameras;
}

void expect_same(const std::vector<Camera>& found, const std::vector<Camera>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].name, expected[i].name);
    EXPECT_EQ(found[i].width, expected[i].width);
    EXPECT_EQ(found[i].height, expected[i].height);
    EXPECT_EQ(found[i].lens, expected[i].lens);
    EXPECT_EQ(found[i].distortion, expected[i].distortion);
    EXPECT_TRUE(found[i].K.isApprox(expected[i].K, kExact));
    EXPECT_TRUE(found[i].R.isApprox(expected[i].R, kExact));
    EXPECT_EQ(found[i].t, expected[i].t);
  }
}

// ---------------------------------------------------------------------------------------------------------- EasyMocap

// The rotation of "07" is a quarter turn about z: R = (0 -1 0; 1 0 0; 0 0 1).
constexpr const char* kIntri =
    "%YAML:1.0\n"
    "---\n"
    "names:\n"
    "  - \"alone\"\n"
    "  - \"07\"\n"
    "  - \"B1\"\n"
    "K_alone: !!opencv-matrix\n"
    "  rows: 3\n"
    "  cols: 3\n"
    "  dt: d\n"
    "  data: [300, 0, 10, 0, 300, 20, 0, 0, 1]\n"
    "dist_alone: !!opencv-matrix\n"
    "  rows: 1\n"
    "  cols: 5\n"
    "  dt: d\n"
    "  data: [0, 0, 0, 0, 0]\n"
    "K_07: !!opencv-matrix\n"
    "   rows: 3\n"
    "   cols: 3\n"
    "   dt: d\n"
    "   data: [ 8.0e+02, 0., 321.5, 0.,\n"
    "       810., 242.25, 0., 0., 1. ]\n"
    "dist_07: !!opencv-matrix\n"
    "   rows: 5\n"
    "   cols: 1\n"
    "   dt: d\n"
    "   data: [ 0.1, -0.02, 0.001, -0.002, 0.005 ]\n"
    "H_07: 480\n"
    "W_07: 640\n"
    "K_B1: !!opencv-matrix\n"
    "   rows: 3\n"
    "   cols: 3\n"
    "   dt: d\n"
    "   data: [ 500., 0., 100., 0., 500., 100., 0., 0., 1. ]\n"
    "D_B1: !!opencv-matrix\n"
    "   rows: 1\n"
    "   cols: 4\n"
    "   dt: d\n"
    "   data: [ 0.5, 0., 0., 0. ]\n"
    "H_B1: -1\n"
    "W_B1: -1\n";
constexpr const char* kExtri =
    "%YAML:1.0\n"
    "---\n"
    "names:\n"
    "  - \"B1\"\n"
    "  - \"07\"\n"
    "  - \"other\"\n"
    "R_B1: !!opencv-matrix\n"
    "  rows: 3\n"
    "  cols: 1\n"
    "  dt: d\n"
    "  data: [0.100000, 0.200000, 0.300000]\n"
    "Rot_B1: !!opencv-matrix\n"
    "  rows: 3\n"
    "  cols: 3\n"
    "  dt: d\n"
    "  data: [0.935755, -0.283165, 0.210192, 0.302933, 0.950581, -0.068031, -0.180540, 0.127335, 0.975290]\n"
    "T_B1: !!opencv-matrix\n"
    "  rows: 3\n"
    "  cols: 1\n"
    "  dt: d\n"
    "  data: [1, 2, 3]\n"
    "R_07: !!opencv-matrix\n"
    "  rows: 3\n"
    "  cols: 1\n"
    "  dt: d\n"
    "  data: [0, 0, 1.5707963267948966]\n"
    "T_07: !!opencv-matrix\n"
    "  rows: 3\n"
    "  cols: 1\n"
    "  dt: d\n"
    "  data: [0.5, -0.25, 1]\n"
    "R_other: !!opencv-matrix\n"
    "  rows: 3\n"
    "  cols: 1\n"
    "  dt: d\n"
    "  data: [0, 0, 0]\n"
    "T_other: !!opencv-matrix\n"
    "  rows: 3\n"
    "  cols: 1\n"
    "  dt: d\n"
    "  data: [0, 0, 0]\n";

class EasyMocap : public ::testing::Test {
 protected:
  EasyMocap() { write(kIntri, kExtri); }
  void write(const std::string& intri, const std::string& extri) {
    files_.write("intri.yml", intri);
    files_.write("extri.yml", extri);
  }
  std::string refusal_of(const std::string& intri, const std::string& extri) {
    write(intri, extri);
    return refusal(format_, files_.path());
  }
  Files files_;
  Format format_ = make_easymocap_calibration();
};

TEST_F(EasyMocap, ProjectsWithRotationVectorAndTranslation) {
  const Calibration calibration = read(format_, files_.path());
  EXPECT_EQ(calibration.unit, "m");
  EXPECT_EQ(calibration.up, "");
  EXPECT_TRUE(calibration.has_poses);
  ASSERT_THAT(names_of(calibration), ElementsAre("07", "B1"));
  const Camera& camera = calibration.cameras[0];
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.height, 480);
  // R (1, 2, 3) + T = (-2, 1, 3) + (0.5, -0.25, 1)
  expect_near(camera.project({1, 2, 3}),
              brown_pixel({800, 810, 321.5, 242.25}, {0.1, -0.02, 0.001, -0.002, 0.005}, {-1.5, 0.75, 4}));
  // -R^T T: the quarter turn back of (-0.5, 0.25, -1)
  EXPECT_TRUE(camera.centre().isApprox(Eigen::Vector3d(0.25, 0.5, -1), kExact));
}

TEST_F(EasyMocap, ReadsOldKeysAndUnknownSizes) {
  const Camera camera = read(format_, files_.path()).cameras[1];
  EXPECT_EQ(camera.distortion[0], 0.5);
  EXPECT_EQ(camera.width, 0);
  EXPECT_EQ(camera.height, 0);
}

TEST_F(EasyMocap, TakesTheVectorWhenTheMatrixHasFewDigits) {
  const Camera camera = read(format_, files_.path()).cameras[1];
  const Eigen::Vector3d vector(0.1, 0.2, 0.3);
  const Eigen::AngleAxisd expected(vector.norm(), vector.normalized());
  EXPECT_TRUE(camera.R.isApprox(expected.toRotationMatrix(), kExact));
}

TEST_F(EasyMocap, TakesTheMatrixWhenThereIsNoVector) {
  write(kIntri,
        replaced(kExtri, "R_07: !!opencv-matrix\n  rows: 3\n  cols: 1\n  dt: d\n  data: [0, 0, 1.5707963267948966]",
                 "Rot_07: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: [0, -1, 0, 1, 0, 0, 0, 0, 1]"));
  const Camera camera = read(format_, files_.path()).cameras[0];
  EXPECT_TRUE((camera.R * Eigen::Vector3d(1, 2, 3)).isApprox(Eigen::Vector3d(-2, 1, 3), kExact));
}

TEST_F(EasyMocap, TakesTheCamerasOfBothFilesAndSaysSo) {
  const Calibration calibration = read(format_, files_.path());
  EXPECT_THAT(calibration.notes, ElementsAre("1 of 3 cameras have no pose in extri.yml and were left out.",
                                             "1 of 3 cameras have no intrinsics in intri.yml and were left out."));
}

TEST_F(EasyMocap, ReadsFromEitherFileAndFromTheFolder) {
  for (const char* name : {"", "intri.yml", "extri.yml"}) {
    EXPECT_TRUE(format_->recognises(source_of(files_.path(name)))) << name;
    EXPECT_EQ(read(format_, files_.path(name)).cameras.size(), 2u) << name;
  }
  files_.write("intri_2.yml", kIntri);
  const fs::path second = files_.write("extri_2.yml", kExtri);
  EXPECT_EQ(read(format_, second).cameras.size(), 2u);
}

TEST_F(EasyMocap, ReadsBothPartsFromOneFile) {
  const std::string poses = std::string(kExtri).substr(std::string(kExtri).find("R_B1"));
  EXPECT_EQ(read(format_, files_.write("both.yml", kIntri + poses)).cameras.size(), 2u);
}

TEST_F(EasyMocap, HasNoPosesWithoutExtri) {
  fs::remove(files_.path("extri.yml"));
  const Calibration calibration = read(format_, files_.path());
  EXPECT_FALSE(calibration.has_poses);
  EXPECT_EQ(calibration.cameras.size(), 3u);
  ASSERT_EQ(calibration.notes.size(), 1u);
  EXPECT_THAT(calibration.notes[0], HasSubstr("extri.yml"));
}

TEST_F(EasyMocap, RefusesExtriWithoutIntri) {
  fs::remove(files_.path("intri.yml"));
  EXPECT_THAT(refusal(format_, files_.path("extri.yml")), HasSubstr("intri.yml"));
}

TEST_F(EasyMocap, NamesWhatIsMissingOrWrong) {
  EXPECT_THAT(refusal_of(replaced(kIntri, "K_07", "K_08"), kExtri), HasSubstr("K_07 is missing"));
  EXPECT_THAT(refusal_of(replaced(kIntri, "dist_07", "dist_08"), kExtri), HasSubstr("dist_07 is missing"));
  EXPECT_THAT(refusal_of(kIntri, replaced(kExtri, "T_07", "T_08")), HasSubstr("T_07 is missing"));
  EXPECT_THAT(refusal_of(replaced(kIntri, "names:", "name:"), kExtri), HasSubstr("names is missing"));
  EXPECT_THAT(refusal_of(replaced(kIntri, "8.0e+02", "x"), kExtri), HasSubstr("intri.yml:17: "));
  EXPECT_THAT(refusal_of(replaced(kIntri, "8.0e+02", ".Nan"), kExtri), HasSubstr("K_07 must hold finite numbers"));
  EXPECT_THAT(refusal_of(replaced(kIntri, "rows: 5", "rows: 1000000000"), kExtri), HasSubstr("dist_07 has 5 numbers"));
  EXPECT_THAT(refusal_of(replaced(kIntri, "W_07: 640", "W_07: 1e200"), kExtri), HasSubstr("W_07"));
  EXPECT_THAT(refusal_of(replaced(kIntri, "\"B1\"", "\"07\""), kExtri), HasSubstr("\"07\" twice"));
  EXPECT_THAT(refusal_of(kIntri, replaced(kExtri, "[0.100000,", "[0.110000,")), HasSubstr("same rotation"));
}

TEST_F(EasyMocap, ReadsBackWhatItWrites) {
  std::vector<Camera> cameras = made_cameras();
  cameras[1].width = cameras[1].height = 0;
  const fs::path folder = files_.path("written");
  fs::create_directory(folder);
  ASSERT_TRUE(format_->can_write() && format_->writes_folder());
  format_->write(folder, cameras);
  EXPECT_TRUE(format_->recognises(source_of(folder)));
  expect_same(read(format_, folder).cameras, cameras);
}

TEST_F(EasyMocap, RefusesToWriteOtherLensesAndNames) {
  const auto message = [&](const std::function<void(Camera&)>& change) {
    std::vector<Camera> cameras = made_cameras();
    change(cameras[1]);
    return message_of<Error>([&] { format_->write(files_.path(), cameras); });
  };
  EXPECT_THAT(message([](Camera& c) { c.lens = Lens::fisheye; }), HasSubstr("right-2"));
  EXPECT_THAT(message([](Camera& c) { c.lens = Lens::polynomial; }), HasSubstr("right-2"));
  EXPECT_THAT(message([](Camera& c) { c.distortion[7] = 0.1; }), HasSubstr("right-2"));
  EXPECT_THAT(message([](Camera& c) { c.name = "a:b"; }), HasSubstr("a:b"));
  EXPECT_THAT(message([](Camera& c) { c.name = "left_1"; }), HasSubstr("two cameras"));
}

TEST_F(EasyMocap, SurvivesHostileFiles) {
  const auto read_file = [&](const fs::path& path) { read(format_, path); };
  support::expect_survives_hostile_files(files_.path("intri.yml"), kIntri, read_file);
  write(kIntri, kExtri);
  support::expect_survives_hostile_files(files_.path("extri.yml"), kExtri, read_file);
}

// ---------------------------------------------------------------------------------------------------- OpenCV's
// programs

std::string matrix_node(const std::string& key, int rows, int cols, const std::string& data) {
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {} ]\n", key, rows, cols,
                     data);
}

const std::string kFileStorage = "%YAML:1.0\n---\n";
const std::string kStereoIntrinsics = kFileStorage +
                                      matrix_node("M1", 3, 3, "800., 0., 321.5, 0., 810., 242.25, 0., 0., 1.") +
                                      matrix_node("D1", 1, 5, "0.1, -0.02, 0.001, -0.002, 0.005") +
                                      matrix_node("M2", 3, 3, "700., 0., 300., 0., 710., 200., 0., 0., 1.") +
                                      matrix_node("D2", 1, 14, "0.1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0");
// R is a quarter turn about z; R1 and R2 are the rotations of the rectification.
const std::string kStereoExtrinsics = kFileStorage + matrix_node("R", 3, 3, "0., -1., 0., 1., 0., 0., 0., 0., 1.") +
                                      "T: [ -60., 2., 3. ]\n" +
                                      matrix_node("R1", 3, 3, "0., 0., 1., 0., 1., 0., -1., 0., 0.") +
                                      matrix_node("R2", 3, 3, "0., 0., 1., 0., 1., 0., -1., 0., 0.");

class OpenCvStereo : public ::testing::Test {
 protected:
  OpenCvStereo() {
    files_.write("intrinsics.yml", kStereoIntrinsics);
    files_.write("extrinsics.yml", kStereoExtrinsics);
  }
  Calibration read_text(const std::string& text) { return read(format_, files_.write("calibration.yml", text)); }
  std::string refusal_of(const std::string& text) { return refusal(format_, files_.write("calibration.yml", text)); }
  bool claims(const std::string& text) { return format_->recognises({"any", text.substr(0, 16 << 10), false}); }
  Files files_;
  Format format_ = make_opencv_stereo_calibration();
};

TEST_F(OpenCvStereo, ReadsThePairFromEitherFile) {
  for (const char* name : {"intrinsics.yml", "extrinsics.yml"}) {
    EXPECT_TRUE(format_->recognises(source_of(files_.path(name)))) << name;
    const Calibration calibration = read(format_, files_.path(name));
    EXPECT_EQ(calibration.unit, "");
    EXPECT_TRUE(calibration.has_poses);
    ASSERT_THAT(names_of(calibration), ElementsAre("1", "2"));
    EXPECT_EQ(calibration.cameras[0].width, 0);
    expect_near(calibration.cameras[0].project({1, 2, 4}),
                brown_pixel({800, 810, 321.5, 242.25}, {0.1, -0.02, 0.001, -0.002, 0.005}, {1, 2, 4}));
    // R (1, 2, 100) + T = (-2, 1, 100) + (-60, 2, 3)
    expect_near(calibration.cameras[1].project({1, 2, 100}), brown_pixel({700, 710, 300, 200}, {0.1}, {-62, 3, 103}));
  }
}

TEST_F(OpenCvStereo, ReadsThePairFromOneFile) {
  const Calibration calibration = read_text(kStereoIntrinsics + kStereoExtrinsics.substr(kFileStorage.size()));
  EXPECT_TRUE(calibration.has_poses);
  EXPECT_EQ(calibration.cameras[1].t, Eigen::Vector3d(-60, 2, 3));
}

// The names of cv::stereoCalibrate's arguments, and those that people give them.
TEST_F(OpenCvStereo, TakesTheIntrinsicsOfTheFileUnderAllNames) {
  struct Spelling {
    const char *matrix1, *distortion1, *matrix2, *distortion2, *R, *T;
  };
  const Spelling spellings[] = {
      {"K1", "D1", "K2", "D2", "R", "T"},
      {"M1", "D1", "M2", "D2", "R", "T"},
      {"cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2", "R", "T"},
      {"CameraMatrix1", "DistCoeffs1", "CameraMatrix2", "DistCoeffs2", "R", "T"},
      {"camera_matrix_1", "dist_coeffs_1", "camera_matrix_2", "dist_coeffs_2", "R", "T"},
      {"camera_matrix1", "distortion_coefficients1", "camera_matrix2", "distortion_coefficients2", "R", "T"},
      {"camera_matrix_left", "dist_coeffs_left", "camera_matrix_right", "dist_coeffs_right", "R", "T"},
      {"camera_matrix_left", "distortion_coefficients_left", "camera_matrix_right", "distortion_coefficients_right",
       "rotation_matrix", "translation_vector"},
      {"left_camera_matrix", "left_distortion_coefficients", "right_camera_matrix", "right_distortion_coefficients",
       "Rotation", "Translation"},
      {"cameraMatrixL", "distCoeffsL", "cameraMatrixR", "distCoeffsR", "R", "T"},
      {"cameraMatrix_l", "distCoeffs_l", "cameraMatrix_r", "distCoeffs_r", "R", "T"},
      {"K_left", "D_left", "K_right", "D_right", "R", "T"},
      {"KL", "DL", "KR", "DR", "R", "T"},
      {"mtxL", "distL", "mtxR", "distR", "R", "T"},
      {"mtx_left", "dist_left", "mtx_right", "dist_right", "rot", "trans"},
      {"intrinsicsLeft", "distortionLeft", "intrinsicsRight", "distortionRight", "R", "T"},
      {"K0", "D0", "K1", "D1", "R", "T"}};
  // Beside it lie intrinsics of other cameras, and extrinsics that are not of this pair.
  for (const Spelling& names : spellings) {
    const std::string text =
        kFileStorage + matrix_node(names.matrix1, 3, 3, "1750., 0., 730., 0., 1751., 530., 0., 0., 1.") +
        matrix_node(names.distortion1, 1, 5, "-0.1, 0.05, 0., 0., 0.") +
        matrix_node(names.matrix2, 3, 3, "1760., 0., 720., 0., 1761., 515., 0., 0., 1.") +
        matrix_node(names.distortion2, 1, 5, "-0.11, 0.04, 0., 0., 0.") +
        matrix_node(names.R, 3, 3, "0., -1., 0., 1., 0., 0., 0., 0., 1.") +
        matrix_node(names.T, 3, 1, "-120., 1., 2.") + matrix_node("R1", 3, 3, "0., 0., 1., 0., 1., 0., -1., 0., 0.") +
        matrix_node("P1", 3, 4, "900., 0., 1., 0., 0., 900., 1., 0., 0., 0., 1., 0.");
    ASSERT_TRUE(claims(text)) << names.matrix1;
    const Calibration calibration = read_text(text);
    ASSERT_EQ(calibration.cameras.size(), 2u) << names.matrix1;
    EXPECT_TRUE(calibration.has_poses);
    EXPECT_EQ(calibration.cameras[0].K(0, 0), 1750) << names.matrix1;
    EXPECT_EQ(calibration.cameras[0].distortion[0], -0.1);
    EXPECT_EQ(calibration.cameras[1].K(1, 1), 1761);
    EXPECT_EQ(calibration.cameras[1].distortion[0], -0.11);
    EXPECT_EQ(calibration.cameras[0].t, Eigen::Vector3d(0, 0, 0));
    EXPECT_EQ(calibration.cameras[1].t, Eigen::Vector3d(-120, 1, 2));
    EXPECT_EQ(calibration.cameras[1].R(1, 0), 1) << names.matrix1;
    EXPECT_THAT(calibration.notes, ::testing::IsEmpty());
  }
}

TEST_F(OpenCvStereo, NamesTheCamerasByTheirSides) {
  const std::string sides = replaced(replaced(kStereoIntrinsics, "M1", "camera_matrix_left"), "D1", "dist_left");
  const std::string text = replaced(replaced(sides, "M2", "camera_matrix_right"), "D2", "dist_right") +
                           kStereoExtrinsics.substr(kFileStorage.size());
  EXPECT_THAT(names_of(read_text(text)), ElementsAre("left", "right"));
}

TEST_F(OpenCvStereo, ReadsTheSizeOfTheImagesUnderAllNames) {
  const std::string pair = kStereoIntrinsics + kStereoExtrinsics.substr(kFileStorage.size());
  for (const char* size :
       {"image_size: [ 640, 480 ]\n", "imageSize: [ 640, 480 ]\n", "frame_width: 640\nframe_height: 480\n",
        "image_width: 640\nimage_height: 480\n", "imageWidth: 640\nimageHeight: 480\n", "width: 640\nheight: 480\n",
        "imageSize1: [ 640, 480 ]\nimageSize2: [ 640, 480 ]\n"}) {
    const Calibration calibration = read_text(pair + size);
    for (const Camera& camera : calibration.cameras) {
      EXPECT_EQ(camera.width, 640) << size;
      EXPECT_EQ(camera.height, 480) << size;
    }
  }
  EXPECT_THAT(refusal_of(pair + "image_size: [ 640, 480, 3 ]\n"), HasSubstr("image_size has 3 numbers, expected 2"));
}

TEST_F(OpenCvStereo, SaysWhichFileTheOtherHalfIsFrom) {
  EXPECT_THAT(read(format_, files_.path("extrinsics.yml")).notes,
              ElementsAre("the intrinsics are those of intrinsics.yml beside the file"));
  EXPECT_THAT(read(format_, files_.path("intrinsics.yml")).notes,
              ElementsAre("the poses are those of extrinsics.yml beside the file"));
}

TEST_F(OpenCvStereo, NeverTakesTheIntrinsicsOfAnotherFileWhenTheFileHasItsOwn) {
  const std::string poses = kStereoExtrinsics.substr(kFileStorage.size());
  // One of two cameras is missing.
  const std::string half = kFileStorage + matrix_node("cameraMatrix1", 3, 3, "9., 0., 1., 0., 9., 1., 0., 0., 1.") +
                           matrix_node("distCoeffs1", 1, 4, "0., 0., 0., 0.");
  EXPECT_THAT(refusal_of(half + poses), HasSubstr("belong to two cameras, found the intrinsics of 1"));
  // Names that nobody can know.
  const std::string unknown = replaced(replaced(kStereoIntrinsics, "M1", "kamera_eins"), "M2", "kamera_zwei");
  EXPECT_THAT(refusal_of(unknown + poses), HasSubstr("kamera_eins looks like the intrinsics of a camera"));
  // A complete file beside intrinsics has poses of its own cameras, unless these are the same: OpenCV's stereo sample
  // writes the intrinsics into both files.
  files_.write("extrinsics.yml", kStereoIntrinsics + poses);
  EXPECT_TRUE(read(format_, files_.path("intrinsics.yml")).has_poses);
  files_.write("extrinsics.yml", replaced(kStereoIntrinsics, "800.", "900.") + poses);
  EXPECT_FALSE(read(format_, files_.path("intrinsics.yml")).has_poses);
}

TEST_F(OpenCvStereo, HasNoPosesWithoutExtrinsics) {
  fs::remove(files_.path("extrinsics.yml"));
  const Calibration calibration = read(format_, files_.path("intrinsics.yml"));
  EXPECT_FALSE(calibration.has_poses);
  EXPECT_EQ(calibration.cameras.size(), 2u);
  EXPECT_EQ(calibration.notes.size(), 1u);
}

TEST_F(OpenCvStereo, RefusesExtrinsicsWithoutIntrinsics) {
  fs::remove(files_.path("intrinsics.yml"));
  EXPECT_THAT(refusal(format_, files_.path("extrinsics.yml")), HasSubstr("intrinsics.yml"));
}

TEST_F(OpenCvStereo, ReadsNumberedCameras) {
  std::string text = kFileStorage;
  for (int i = 1; i <= 4; ++i) {
    text += matrix_node(fmt::format("K{}", i), 3, 3, fmt::format("{}., 0., 50., 0., 600., 40., 0., 0., 1.", 500 + i));
    text += matrix_node(fmt::format("D{}", i), 1, 4, "0., 0., 0., 0.");
  }
  text += matrix_node("R2", 3, 1, "0., 0., 1.5707963267948966") + matrix_node("T2", 3, 1, "1., 2., 3.");
  text += matrix_node("R4", 3, 3, "1., 0., 0., 0., 0., -1., 0., 1., 0.") + matrix_node("T4", 3, 1, "4., 5., 6.");
  const Calibration calibration = read_text(text);
  ASSERT_THAT(names_of(calibration), ElementsAre("1", "2", "4"));
  EXPECT_EQ(calibration.cameras[0].t, Eigen::Vector3d(0, 0, 0));
  EXPECT_TRUE(calibration.cameras[1].camera_from_world({1, 0, 0}).isApprox(Eigen::Vector3d(1, 3, 3), kExact));
  EXPECT_TRUE(calibration.cameras[2].camera_from_world({0, 0, 1}).isApprox(Eigen::Vector3d(4, 4, 6), kExact));
  EXPECT_EQ(calibration.cameras[2].K(0, 0), 504);
  EXPECT_THAT(calibration.notes, ElementsAre("1 of 4 cameras have no pose and were left out."));
}

TEST_F(OpenCvStereo, ReadsTheArraysOfTheMultiviewCalibration) {
  const std::string text =
      kFileStorage + matrix_node("rvecs", 2, 3, "0., 0., 0., 0., 0., 1.5707963267948966") +
      matrix_node("distortions", 2, 4, "0.01, 0.02, 0.03, 0.04, 0.1, -0.02, 0.001, -0.002") +
      "Ks: !!opencv-nd-matrix\n   sizes: [ 2, 3, 3 ]\n   dt: d\n   data: [ 400., 0., 100., 0., 410., 90., 0., 0., 1., "
      "500., 0., 110., 0., 510., 80., 0., 0., 1. ]\n" +
      matrix_node("Ts", 2, 3, "0., 0., 0., 0.5, -0.25, 1.") + matrix_node("is_fisheye", 2, 1, "1, 0") +
      matrix_node("image_sizes", 2, 2, "200, 180, 220, 160") + "cam_ids: \"7,front\"\n";
  EXPECT_TRUE(claims(text));
  const Calibration calibration = read_text(text);
  ASSERT_THAT(names_of(calibration), ElementsAre("7", "front"));
  EXPECT_EQ(calibration.cameras[1].width, 220);
  EXPECT_EQ(calibration.cameras[1].height, 160);
  expect_near(calibration.cameras[0].project({1, 2, 4}),
              fisheye_pixel({400, 410, 100, 90}, {0.01, 0.02, 0.03, 0.04}, {1, 2, 4}));
  expect_near(calibration.cameras[1].project({1, 2, 3}),
              brown_pixel({500, 510, 110, 80}, {0.1, -0.02, 0.001, -0.002}, {-1.5, 0.75, 4}));
}

const std::string kSingle = kFileStorage + "image_width: 640\nimage_height: 480\n" +
                            matrix_node("camera_matrix", 3, 3, "800., 0., 321.5, 0., 810., 242.25, 0., 0., 1.") +
                            matrix_node("distortion_coefficients", 5, 1, "0.1, -0.02, 0.001, -0.002, 0.005") +
                            matrix_node("extrinsic_parameters", 1, 6, "1., 2., 3., 4., 5., 6.");

TEST_F(OpenCvStereo, ReadsTheIntrinsicsOfOneCamera) {
  EXPECT_TRUE(claims(kSingle));
  const Calibration calibration = read(format_, files_.write("cam3.yml", kSingle));
  EXPECT_FALSE(calibration.has_poses);
  ASSERT_THAT(names_of(calibration), ElementsAre("cam3"));
  EXPECT_EQ(calibration.cameras[0].width, 640);
  EXPECT_EQ(calibration.cameras[0].height, 480);
  expect_near(calibration.cameras[0].project({1, 2, 4}),
              brown_pixel({800, 810, 321.5, 242.25}, {0.1, -0.02, 0.001, -0.002, 0.005}, {1, 2, 4}));
}

TEST_F(OpenCvStereo, ReadsXmlAndFisheyeLenses) {
  const auto node = [](const char* key, int rows, int cols, const char* data) {
    return fmt::format(
        "<{0} type_id=\"opencv-matrix\">\n  <rows>{1}</rows>\n  <cols>{2}</cols>\n  <dt>d</dt>\n  <data>\n"
        "    {3}</data></{0}>\n",
        key, rows, cols, data);
  };
  const std::string text =
      "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>640</image_width>\n"
      "<image_height>480</image_height>\n<fisheye_model>1</fisheye_model>\n" +
      node("camera_matrix", 3, 3, "400. 0. 100. 0. 410. 90. 0. 0. 1.") +
      node("distortion_coefficients", 4, 1, "0.01 0.02 0.03 0.04") + "</opencv_storage>\n";
  EXPECT_TRUE(claims(text));
  const Calibration calibration = read(format_, files_.write("out.xml", text));
  expect_near(calibration.cameras.at(0).project({1, 2, 4}),
              fisheye_pixel({400, 410, 100, 90}, {0.01, 0.02, 0.03, 0.04}, {1, 2, 4}));
}

TEST_F(OpenCvStereo, DoesNotClaimFilesWithOneMapPerCamera) {
  const std::string camera =
      "   width: 640\n   height: 480\n   K: !!opencv-matrix\n      rows: 3\n      cols: 3\n      dt: d\n"
      "      data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]\n   R: [ 1 ]\n   t: [ 1 ]\n";
  EXPECT_FALSE(claims("%YAML:1.0\n---\nunits: metres\npixel_centre: 0.5\ncount: 1\ncam0:\n" + camera));
  EXPECT_FALSE(
      claims("<?xml version=\"1.0\"?>\n<opencv_storage>\n<units>metres</units>\n<cam0>\n<K "
             "type_id=\"opencv-matrix\"></K><R type_id=\"opencv-matrix\"></R><t "
             "type_id=\"opencv-matrix\"></t></cam0></opencv_storage>"));
  EXPECT_FALSE(claims("{ \"cam0\": { \"K\": { \"type_id\": \"opencv-matrix\" }, \"R\": 1, \"t\": 2 } }"));
  EXPECT_FALSE(claims(""));
}

TEST_F(OpenCvStereo, NamesWhatIsMissingOrWrong) {
  EXPECT_THAT(refusal_of(replaced(kSingle, "distortion_coefficients", "coefficients")),
              HasSubstr("distortion_coefficients is missing"));
  EXPECT_THAT(refusal_of(replaced(kSingle, "image_height", "rows")), HasSubstr("image_height is missing"));
  EXPECT_THAT(refusal_of(replaced(kSingle, "640", "-640")), HasSubstr("image_width"));
  EXPECT_THAT(refusal_of(replaced(kSingle, "800.", ".Nan")), HasSubstr("camera_matrix must hold finite numbers"));
  EXPECT_THAT(refusal_of(replaced(kSingle, "rows: 3", "rows: 1000000000")), HasSubstr("camera_matrix has 9 numbers"));
  EXPECT_THAT(refusal_of(replaced(kStereoIntrinsics, "D2", "D3")), HasSubstr("D2 is missing"));
  EXPECT_THAT(refusal_of(kFileStorage + "a: 1\n"), HasSubstr("camera_matrix"));
  EXPECT_THAT(refusal_of(kFileStorage + "a: " + std::string(200000, '[')), HasSubstr("nested more than 100 deep"));
  EXPECT_THAT(refusal_of(kFileStorage + "a:\n   " + support::replaced(std::string(200000, '-'), "-", "- -")),
              HasSubstr("reading a camera calibration"));
}

TEST_F(OpenCvStereo, SurvivesHostileFiles) {
  const auto read_file = [&](const fs::path& path) { read(format_, path); };
  support::expect_survives_hostile_files(files_.path("intrinsics.yml"), kStereoIntrinsics, read_file);
  files_.write("intrinsics.yml", kStereoIntrinsics);
  support::expect_survives_hostile_files(files_.path("extrinsics.yml"), kStereoExtrinsics, read_file);
  support::expect_survives_hostile_files(files_.path("single.yml"), kSingle, read_file);
}

// ---------------------------------------------------------------------------------------------------------------- ROS

constexpr const char* kRos =
    "image_width: 640\n"
    "image_height: 480\n"
    "camera_name: front\n"
    "camera_matrix:\n"
    "  rows: 3\n"
    "  cols: 3\n"
    "  data: [800, 0, 321.5, 0, 810, 242.25, 0, 0, 1]\n"
    "distortion_model: plumb_bob\n"
    "distortion_coefficients:\n"
    "  rows: 1\n"
    "  cols: 5\n"
    "  data: [0.1, -0.02, 0.001, -0.002, 0.005]\n"
    "projection_matrix:\n"
    "  rows: 3\n"
    "  cols: 4\n"
    "  data: [1, 0, 2, 0, 0, 1, 2, 0, 0, 0, 1, 0]\n";

class Ros : public ::testing::Test {
 protected:
  Calibration read_text(const std::string& text) { return read(format_, files_.write("camera.yaml", text)); }
  std::string refusal_of(const std::string& text) { return refusal(format_, files_.write("camera.yaml", text)); }
  Files files_;
  Format format_ = make_ros_calibration();
};

TEST_F(Ros, ReadsTheIntrinsics) {
  const Calibration calibration = read_text(kRos);
  EXPECT_TRUE(format_->recognises(source_of(files_.path("camera.yaml"))));
  EXPECT_FALSE(calibration.has_poses);
  ASSERT_THAT(names_of(calibration), ElementsAre("front"));
  EXPECT_EQ(calibration.cameras[0].width, 640);
  EXPECT_EQ(calibration.cameras[0].height, 480);
  expect_near(calibration.cameras[0].project({1, 2, 4}),
              brown_pixel({800, 810, 321.5, 242.25}, {0.1, -0.02, 0.001, -0.002, 0.005}, {1, 2, 4}));
}

TEST_F(Ros, ReadsAllModels) {
  const std::string rational =
      replaced(replaced(kRos, "plumb_bob", "rational_polynomial"), "0.005]", "0.005, 1, 2, 3]");
  EXPECT_EQ(read_text(rational).cameras.at(0).distortion[7], 3);
  const std::string fisheye = replaced(replaced(kRos, "plumb_bob", "equidistant"), ", 0.005]", "]");
  expect_near(read_text(fisheye).cameras.at(0).project({1, 2, 4}),
              fisheye_pixel({800, 810, 321.5, 242.25}, {0.1, -0.02, 0.001, -0.002}, {1, 2, 4}));
  EXPECT_THAT(refusal_of(replaced(kRos, "plumb_bob", "mei")), HasSubstr("distortion_model is \"mei\""));
}

TEST_F(Ros, NamesWhatIsMissingOrWrong) {
  EXPECT_THAT(refusal_of(replaced(kRos, "camera_matrix", "Kamera")), HasSubstr("camera_matrix or K or k is missing"));
  EXPECT_THAT(refusal_of(replaced(kRos, "distortion_model", "model")), HasSubstr("distortion_model is missing"));
  EXPECT_THAT(refusal_of(replaced(kRos, "image_width", "breadth")), HasSubstr("image_width or width is missing"));
  EXPECT_THAT(refusal_of(replaced(kRos, "810", ".nan")), HasSubstr("camera.yaml:7: "));
  EXPECT_THAT(refusal_of(replaced(kRos, "640", "1e200")), HasSubstr("image_width"));
  EXPECT_THAT(refusal_of(replaced(kRos, "640", "0.5")), HasSubstr("image_width"));
  EXPECT_THAT(refusal_of(replaced(kRos, ", 0, 0, 1]", "]")), HasSubstr("6 numbers"));
}

/// What `rostopic echo` prints; `ros2 topic echo` prints lists as `block` does.
std::string ros1_message(int sequence = 7) {
  return fmt::format(
      "header: \n  seq: {}\n  stamp: \n    secs: {}\n    nsecs: 500000000\n  frame_id: \"cam_0_optical_frame\"\n"
      "height: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\nD: [0.1, -0.02, 0.001, -0.002, 0.005]\n"
      "K: [800.0, 0.0, 321.5, 0.0, 810.0, 242.25, 0.0, 0.0, 1.0]\nR: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
      "P: [458.0, 0.0, 367.0, 0.0, 0.0, 457.0, 248.0, 0.0, 0.0, 0.0, 1.0, 0.0]\nbinning_x: 0\nbinning_y: 0\nroi: \n"
      "  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: False\n---\n",
      sequence, sequence + 5);
}

std::string ros2_message(const char* item = "- ") {
  std::string text =
      "header:\n  stamp:\n    sec: 12\n    nanosec: 500000000\n  frame_id: camera\nheight: 480\nwidth: 640\n"
      "distortion_model: plumb_bob\n";
  const auto list = [&](const char* key, const std::vector<double>& values) {
    text += fmt::format("{}:\n", key);
    for (const double value : values) text += fmt::format("{}{}\n", item, value);
  };
  list("d", {0.1, -0.02, 0.001, -0.002, 0.005});
  list("k", {800, 0, 321.5, 0, 810, 242.25, 0, 0, 1});
  list("r", {1, 0, 0, 0, 1, 0, 0, 0, 1});
  list("p", {458, 0, 367, 0, 0, 457, 248, 0, 0, 0, 1, 0});
  return text +
         "binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n"
         "  do_rectify: false\n---\n";
}

TEST_F(Ros, ReadsTheMessageAsItIsPrinted) {
  const std::string once = ros1_message();
  for (const std::string& text :
       {once, once.substr(0, once.size() - 4), "---\n" + once, ros2_message(), ros2_message("  - "),
        replaced(replaced(once, "D: ", "d: "), "K: ", "k: "), ros1_message(1) + ros1_message(2) + ros1_message(3),
        // The last message of a recording is cut off.
        ros1_message(1) + ros1_message(2) + once.substr(0, 40),
        ros1_message(1) + once.substr(0, once.find("K: ") + 9)}) {
    const Calibration calibration = read_text(text);
    EXPECT_TRUE(format_->recognises(source_of(files_.path("camera.yaml"))));
    EXPECT_FALSE(calibration.has_poses);
    ASSERT_THAT(names_of(calibration), ElementsAre("camera")) << "named by the file";
    EXPECT_EQ(calibration.cameras[0].width, 640);
    EXPECT_EQ(calibration.cameras[0].height, 480);
    expect_near(calibration.cameras[0].project({1, 2, 4}),
                brown_pixel({800, 810, 321.5, 242.25}, {0.1, -0.02, 0.001, -0.002, 0.005}, {1, 2, 4}));
  }
}

TEST_F(Ros, RefusesMessagesOfSeveralCameras) {
  const std::string first = ros1_message(1), other = replaced(ros1_message(2), "800.0", "700.0");
  const std::string message = refusal_of(first + other);
  EXPECT_THAT(message, HasSubstr("another camera"));
  EXPECT_THAT(message, HasSubstr(fmt::format("camera.yaml:{}: ", std::count(first.begin(), first.end(), '\n') + 1)));
  EXPECT_THAT(refusal_of(first + replaced(other, "\n---", "")), HasSubstr("another camera"));
  EXPECT_THAT(refusal_of(first + replaced(ros1_message(2), "D: [", "D: [x, ")), HasSubstr("finite numbers"));
  EXPECT_THAT(refusal_of(kRos + std::string("---\n") + replaced(kRos, "800", "700")), HasSubstr("another camera"));
}

// The message states K of the whole sensor; the images are its region of interest, binned.
TEST_F(Ros, TheImagesOfAMessageAreTheBinnedRegion) {
  std::string text = replaced(replaced(ros1_message(), "binning_x: 0", "binning_x: 2"), "binning_y: 0", "binning_y: 4");
  text = replaced(replaced(text, "x_offset: 0", "x_offset: 100"), "y_offset: 0", "y_offset: 40");
  text = replaced(replaced(text, "  height: 0", "  height: 400"), "  width: 0", "  width: 500");
  const Camera camera = read_text(text).cameras.at(0);
  EXPECT_EQ(camera.width, 250);
  EXPECT_EQ(camera.height, 100);
  const Camera whole = read_text(ros1_message()).cameras.at(0);
  const Eigen::Vector2d pixel = whole.project({1, 2, 4});
  expect_near(camera.project({1, 2, 4}), {(pixel.x() - 100) / 2, (pixel.y() - 40) / 4});
  EXPECT_THAT(refusal_of(replaced(text, "  width: 500", "  width: 600")), HasSubstr("region of interest"));
}

TEST_F(Ros, CamerasWithoutDistortionNeedNoModel) {
  const std::string none = replaced(ros1_message(), "D: [0.1, -0.02, 0.001, -0.002, 0.005]", "D: []");
  EXPECT_FALSE(read_text(replaced(none, "plumb_bob", "")).cameras.at(0).has_distortion());
  EXPECT_THAT(refusal_of(replaced(ros1_message(), "plumb_bob", "")), HasSubstr("distortion_model is \"\""));
}

TEST_F(Ros, SurvivesHostileFiles) {
  support::expect_survives_hostile_files(files_.path("message.yaml"), ros1_message(1) + ros1_message(2),
                                         [&](const fs::path& path) { read(format_, path); });
  support::expect_survives_hostile_files(files_.path("camera.yaml"), kRos,
                                         [&](const fs::path& path) { read(format_, path); });
}

// ------------------------------------------------------------------------------------------------------------- Kalibr

// T_cam_imu of cam0 is a quarter turn about z.
constexpr const char* kCamchain =
    "%YAML:1.0 # for OpenCV\n"
    "\n"
    "cam0:\n"
    "  T_cam_imu:\n"
    "    - [0.0, -1.0, 0.0, 0.5]\n"
    "    - [1.0, 0.0, 0.0, -0.25]\n"
    "    - [0.0, 0.0, 1.0, 1.0]\n"
    "    - [0.0, 0.0, 0.0, 1.0]\n"
    "  camera_model: pinhole\n"
    "  distortion_coeffs: [0.1, -0.02, 0.001, -0.002]\n"
    "  distortion_model: radtan\n"
    "  intrinsics: [800, 810, 321.5, 242.25]\n"
    "  resolution: [640, 480]\n"
    "cam1:\n"
    "  T_cam_imu:\n"
    "  - [1.0, 0.0, 0.0, -0.1]\n"
    "  - [0.0, 1.0, 0.0, 0.0]\n"
    "  - [0.0, 0.0, 1.0, 0.0]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n"
    "  camera_model: pinhole\n"
    "  distortion_coeffs: [0.01, 0.02, 0.03, 0.04]\n"
    "  distortion_model: equidistant\n"
    "  intrinsics: [400, 410, 100, 90]\n"
    "  resolution: [200, 180]\n";

std::string chain_item(int i, const std::string& pose) {
  return fmt::format(
      "cam{}:\n{}  camera_model: pinhole\n  distortion_coeffs: [0, 0, 0, 0]\n  distortion_model: radtan\n"
      "  intrinsics: [400, 410, 100, 90]\n  resolution: [200, 180]\n",
      i, pose);
}

class Kalibr : public ::testing::Test {
 protected:
  Calibration read_text(const std::string& text) { return read(format_, files_.write("camchain.yaml", text)); }
  std::string refusal_of(const std::string& text) { return refusal(format_, files_.write("camchain.yaml", text)); }
  Files files_;
  Format format_ = make_kalibr_calibration();
};

TEST_F(Kalibr, ReadsPosesFromTheImu) {
  const Calibration calibration = read_text(kCamchain);
  EXPECT_TRUE(format_->recognises(source_of(files_.path("camchain.yaml"))));
  EXPECT_EQ(calibration.unit, "m");
  EXPECT_EQ(calibration.up, "");
  ASSERT_THAT(names_of(calibration), ElementsAre("cam0", "cam1"));
  EXPECT_EQ(calibration.cameras[0].width, 640);
  EXPECT_EQ(calibration.cameras[0].height, 480);
  expect_near(calibration.cameras[0].project({1, 2, 3}),
              brown_pixel({800, 810, 321.5, 242.25}, {0.1, -0.02, 0.001, -0.002}, {-1.5, 0.75, 4}));
  expect_near(calibration.cameras[1].project({1.1, 2, 4}),
              fisheye_pixel({400, 410, 100, 90}, {0.01, 0.02, 0.03, 0.04}, {1, 2, 4}));
}

TEST_F(Kalibr, FollowsTheChainFromTheFirstCamera) {
  const std::string step = "  T_cn_cnm1: [[0, -1, 0, 0.5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
  const std::string text = chain_item(0, "") + chain_item(1, step) + chain_item(2, step);
  const Calibration calibration = read_text(text);
  EXPECT_EQ(calibration.cameras.at(0).centre(), Eigen::Vector3d(0, 0, 0));
  // (1, 2, 3) -> (-2 + 0.5, 1, 3) -> (-1 + 0.5, -1.5, 3)
  EXPECT_TRUE(calibration.cameras.at(1).camera_from_world({1, 2, 3}).isApprox(Eigen::Vector3d(-1.5, 1, 3), kExact));
  EXPECT_TRUE(calibration.cameras.at(2).camera_from_world({1, 2, 3}).isApprox(Eigen::Vector3d(-0.5, -1.5, 3), kExact));
  EXPECT_THAT(refusal_of(chain_item(0, "") + chain_item(1, "") + chain_item(2, step)),
              HasSubstr("cam1.T_cn_cnm1 is missing"));
}

TEST_F(Kalibr, ReadsPosesOfTheImuInTheCamera) {
  const std::string pose = "  T_imu_cam: [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]\n";
  EXPECT_TRUE(read_text(chain_item(0, pose)).cameras.at(0).centre().isApprox(Eigen::Vector3d(1, 2, 3), kExact));
}

TEST_F(Kalibr, HasNoPosesWhenThereAreNone) { EXPECT_FALSE(read_text(chain_item(0, "")).has_poses); }

TEST_F(Kalibr, NamesWhatIsMissingOrWrong) {
  EXPECT_THAT(refusal_of(replaced(kCamchain, "pinhole", "omni")), HasSubstr("cam0.camera_model is \"omni\""));
  EXPECT_THAT(refusal_of(replaced(kCamchain, "radtan", "fov")), HasSubstr("cam0.distortion_model is \"fov\""));
  EXPECT_THAT(refusal_of(replaced(kCamchain, "intrinsics", "intrinsic")), HasSubstr("cam0.intrinsics is missing"));
  EXPECT_THAT(refusal_of(replaced(kCamchain, "resolution", "size")), HasSubstr("cam0.resolution is missing"));
  EXPECT_THAT(refusal_of(replaced(kCamchain, "cam1", "cam2")), HasSubstr("cam1 is missing"));
  EXPECT_THAT(refusal_of(replaced(kCamchain, "[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0, 2.0]")), HasSubstr("last row"));
  EXPECT_THAT(refusal_of(replaced(kCamchain, "321.5", ".nan")), HasSubstr("camchain.yaml:12: "));
}

TEST_F(Kalibr, SurvivesHostileFiles) {
  support::expect_survives_hostile_files(files_.path("camchain.yaml"), kCamchain,
                                         [&](const fs::path& path) { read(format_, path); });
}

// --------------------------------------------------------------------------------------------------------------- TOML

// The tables are not in the order of their names. The first rotation is a quarter turn about z.
constexpr const char* kToml =
    "[cam_2]\n"
    "name = \"left\"\n"
    "size = [ 640.0, 480.0,]\n"
    "matrix = [ [ 800.0, 0.0, 321.5,], [ 0.0, 810, 242.25,],\n"
    "  [ 0.0, 0.0, 1.0,],]\n"
    "distortions = [ 0.1, -0.02, 0.001, -0.002, 0.005,]\n"
    "rotation = [ 0.0, 0.0, 1.5707963267948966,]\n"
    "translation = [ 500.0, -250.0, 1000.0,]\n"
    "fisheye = false\n"
    "\n"
    "[cam_10]\n"
    "size = [ 200, 180]\n"
    "matrix = [ [ 400.0, 0.0, 100.0], [ 0.0, 410.0, 90.0], [ 0.0, 0.0, 1.0]]\n"
    "distortions = [ 0.01, 0.02, 0.03, 0.04]\n"
    "rotation = [ 0.0, 0.0, 0.0]\n"
    "translation = [ 0.0, 0.0, 0.0]\n"
    "fisheye = true\n"
    "\n"
    "[metadata]\n"
    "adjusted = false\n";

class Toml : public ::testing::Test {
 protected:
  Calibration read_text(const std::string& text) { return read(format_, files_.write("calibration.toml", text)); }
  std::string refusal_of(const std::string& text) { return refusal(format_, files_.write("calibration.toml", text)); }
  Files files_;
  Format format_ = make_toml_calibration();
};

TEST_F(Toml, ReadsTheNumbersOfTheFileWhenItHasNoUnit) {
  const Calibration calibration = read_text(kToml);
  EXPECT_TRUE(format_->recognises(source_of(files_.path("calibration.toml"))));
  EXPECT_EQ(calibration.unit, "");
  EXPECT_EQ(calibration.up, "");
  ASSERT_THAT(names_of(calibration), ElementsAre("left", "cam_10"));
  EXPECT_EQ(calibration.cameras[0].width, 640);
  EXPECT_EQ(calibration.cameras[0].height, 480);
  // R (1000, 2000, 3000) + t = (-2000, 1000, 3000) + (500, -250, 1000)
  expect_near(calibration.cameras[0].project({1000, 2000, 3000}),
              brown_pixel({800, 810, 321.5, 242.25}, {0.1, -0.02, 0.001, -0.002, 0.005}, {-1500, 750, 4000}));
  expect_near(calibration.cameras[1].project({1, 2, 4}),
              fisheye_pixel({400, 410, 100, 90}, {0.01, 0.02, 0.03, 0.04}, {1, 2, 4}));
}

TEST_F(Toml, TakesTheUnitFromTheSquaresOfFreeMoCap) {
  const auto with_square = [&](const char* size) {
    return read_text(std::string(kToml) + "charuco_square_size = " + size + "\n");
  };
  const Calibration millimetres = with_square("58.0");
  EXPECT_EQ(millimetres.unit, "mm");
  EXPECT_TRUE(millimetres.cameras.at(0).t.isApprox(Eigen::Vector3d(0.5, -0.25, 1), kExact));
  EXPECT_EQ(with_square("0.058").unit, "m");
  EXPECT_EQ(with_square("0.058").cameras.at(0).t.x(), 500);
  EXPECT_EQ(with_square("39").unit, "mm");
  EXPECT_EQ(with_square("1").unit, "");
  EXPECT_EQ(with_square("\"58\"").unit, "");
}

TEST_F(Toml, LeavesOutCamerasWithoutPose) {
  std::string text = replaced(kToml, "rotation = [ 0.0, 0.0, 0.0]\ntranslation = [ 0.0, 0.0, 0.0]\n", "");
  Calibration calibration = read_text(text);
  EXPECT_THAT(names_of(calibration), ElementsAre("left"));
  EXPECT_THAT(calibration.notes, ElementsAre("1 of 2 cameras have no pose and were left out."));
  text = replaced(text, "rotation = [ 0.0, 0.0, 1.5707963267948966,]", "rotation = \"null\"");
  calibration = read_text(replaced(text, "translation = [ 500.0, -250.0, 1000.0,]\n", ""));
  EXPECT_FALSE(calibration.has_poses);
  EXPECT_EQ(calibration.cameras.size(), 2u);
}

TEST_F(Toml, TakesZerosInAllCamerasForMissingPoses) {
  const std::string text = replaced(kToml, "1.5707963267948966", "0.0");
  EXPECT_TRUE(read_text(text).has_poses);
  EXPECT_FALSE(read_text(replaced(text, "500.0, -250.0, 1000.0", "0, 0, 0")).has_poses);
}

TEST_F(Toml, ReadsAllOfTomlThatIsLegal) {
  const std::string odd =
      "# a comment with [ and \"\n"
      "title = \"a ] [ # \\\" string\" # ]\n"
      "path = 'C:\\'\n"
      "lines = \"\"\" \"quoted\" ]\n[not a header\n\"\"\"\n"
      "more = \'\'\'\n[.nor this\n\'\'\'\n"
      "empty = \"\"\n"
      "date = 2024-02-03T04:05:06Z\n"
      "[[list]]\na = { b = [1, 2], c = \"}\" }\n"
      "[ \"quoted.key\" . inner ]\nx = [\n  [ +1.0,\n    # ]\n    2 ],\n]\n";
  const std::string name = "k\xC3\xA4mera ]";
  const Calibration calibration = read_text(odd + replaced(kToml, "left", name));
  EXPECT_THAT(names_of(calibration), ElementsAre(name, "cam_10"));
  EXPECT_EQ(read_text(support::with_crlf(odd + kToml)).cameras.size(), 2u);
  EXPECT_EQ(read_text("\xEF\xBB\xBF" + std::string(kToml)).cameras.size(), 2u);
}

TEST_F(Toml, NamesWhatIsMissingOrWrong) {
  EXPECT_THAT(refusal_of(replaced(kToml, "matrix", "K")), HasSubstr("cam_2.matrix is missing"));
  EXPECT_THAT(refusal_of(replaced(kToml, "translation", "t")), HasSubstr("cam_2.translation is missing"));
  EXPECT_THAT(refusal_of(replaced(kToml, "distortions", "d")), HasSubstr("cam_2.distortions is missing"));
  EXPECT_THAT(refusal_of(replaced(kToml, "-250.0", "nan")), HasSubstr("calibration.toml:8: "));
  EXPECT_THAT(refusal_of(replaced(kToml, "640.0", "1e200")), HasSubstr("cam_2.size"));
  EXPECT_THAT(refusal_of(replaced(kToml, "0.04]", "0.04, 1.0]")), HasSubstr("cam_10 has 5 coefficients"));
  for (const char* line :
       {"[#]", "[.a]", "[[ .a]]", "[[[a]]]", "  [", "[\n", "[\xC3\xA9]", "a = [}", "a = \x01", "a = \xC3\xA9"})
    EXPECT_THAT(refusal_of(std::string(kToml) + line), HasSubstr("calibration.toml:21: ")) << line;
  EXPECT_THAT(refusal_of(replaced(kToml, "fisheye = false", "fisheye = ")), HasSubstr("calibration.toml:9: "));
  EXPECT_THAT(refusal_of("a = " + std::string(100000, '[')), HasSubstr("TOML"));
}

TEST_F(Toml, ReadsBackWhatItWrites) {
  std::vector<Camera> cameras = made_cameras();
  cameras[0].name = "a \"quoted\" \\ name\n";
  cameras.push_back(cameras[0]);
  cameras[2].lens = Lens::fisheye;
  cameras[2].distortion = {0.1, 0, 0, 0};
  cameras.push_back(cameras[0]);
  cameras[3].distortion = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 1e-200, 1e25};
  cameras.push_back(cameras[0]);
  cameras[4].R = Eigen::Matrix3d::Identity();
  cameras[4].distortion = {};
  cameras[4].width = cameras[4].height = 0;
  cameras.push_back(cameras[0]);
  cameras[5].R = Eigen::Vector3d(1, -1, -1).asDiagonal();
  ASSERT_TRUE(format_->can_write());
  ASSERT_FALSE(format_->writes_folder());
  const fs::path path = files_.path("written.toml");
  format_->write(path, cameras);
  EXPECT_TRUE(format_->recognises(source_of(path)));
  const Calibration calibration = read(format_, path);
  EXPECT_EQ(calibration.unit, "");
  expect_same(calibration.cameras, cameras);
}

TEST_F(Toml, RefusesToWriteOtherLenses) {
  std::vector<Camera> cameras = made_cameras();
  cameras[1].lens = Lens::polynomial;
  EXPECT_THAT(message_of<Error>([&] { format_->write(files_.path("written.toml"), cameras); }), HasSubstr("right-2"));
}

TEST_F(Toml, SurvivesHostileFiles) {
  support::expect_survives_hostile_files(files_.path("calibration.toml"), kToml,
                                         [&](const fs::path& path) { read(format_, path); });
}

// ---------------------------------------------------------------------------------------------------------- Caliscope

// The rotation of camera 0 is a quarter turn about z, as a matrix; camera 3 has the same as a vector.
constexpr const char* kCaliscope =
    "[cameras.0]\n"
    "cam_id = 0\n"
    "rotation_count = -1\n"
    "ignore = false\n"
    "size = [640, 480]\n"
    "matrix = [[800.0, 0.0, 321.5], [0.0, 810.0, 242.25], [0.0, 0.0, 1.0]]\n"
    "distortions = [0.1, -0.02, 0.001, -0.002, 0.005]\n"
    "translation = [0.5, -0.25, 1.0]\n"
    "rotation = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]\n"
    "\n"
    "[cameras.3]\n"
    "port = 3\n"
    "rotation_count = 0\n"
    "size = [200, 180]\n"
    "fisheye = true\n"
    "matrix = [[400.0, 0.0, 100.0], [0.0, 410.0, 90.0], [0.0, 0.0, 1.0]]\n"
    "distortions = [0.01, 0.02, 0.03, 0.04]\n"
    "translation = [0.5, -0.25, 1.0]\n"
    "rotation = [0.0, 0.0, 1.5707963267948966]\n";

class Caliscope : public ::testing::Test {
 protected:
  Calibration read_text(const std::string& text) { return read(format_, files_.write("camera_array.toml", text)); }
  std::string refusal_of(const std::string& text) { return refusal(format_, files_.write("camera_array.toml", text)); }
  Files files_;
  Format format_ = make_caliscope_calibration();
};

TEST_F(Caliscope, ReadsRotationsAsMatrixAndAsVector) {
  const Calibration calibration = read_text(kCaliscope);
  EXPECT_TRUE(format_->recognises(source_of(files_.path("camera_array.toml"))));
  EXPECT_EQ(calibration.up, "");
  ASSERT_THAT(names_of(calibration), ElementsAre("0", "3"));
  EXPECT_EQ(calibration.cameras[0].width, 640);
  EXPECT_EQ(calibration.cameras[0].height, 480);
  // R (1, 2, 3) + t = (-2, 1, 3) + (0.5, -0.25, 1); the image is not turned by rotation_count
  expect_near(calibration.cameras[0].project({1, 2, 3}),
              brown_pixel({800, 810, 321.5, 242.25}, {0.1, -0.02, 0.001, -0.002, 0.005}, {-1.5, 0.75, 4}));
  expect_near(calibration.cameras[1].project({1, 2, 3}),
              fisheye_pixel({400, 410, 100, 90}, {0.01, 0.02, 0.03, 0.04}, {-1.5, 0.75, 4}));
}

TEST_F(Caliscope, IsMetricWhenABoardGaveTheScale) {
  EXPECT_EQ(read_text(kCaliscope).unit, "");
  for (const char* board : {"square_size_override_cm = 5.4\n", "square_size_overide_cm = 5\n",
                            "square_size_override_cm = \"null\"\nboard_height = 11.0\nboard_width = 8.5\n"}) {
    files_.write("charuco.toml", board);
    const Calibration calibration = read_text(kCaliscope);
    EXPECT_EQ(calibration.unit, "m") << board;
    EXPECT_EQ(calibration.cameras.at(0).t.x(), 0.5);
  }
  files_.write("charuco.toml", "columns = 4\n");
  EXPECT_EQ(read_text(kCaliscope).unit, "");
  files_.write("charuco.toml", "columns = ");
  EXPECT_THAT(refusal_of(kCaliscope), HasSubstr("charuco.toml:1: "));
}

TEST_F(Caliscope, LeavesOutCamerasAndSaysSo) {
  const std::string more =
      "[cameras.4]\ncam_id = 4\nsize = [2, 2]\nmatrix = \"null\"\nrotation = \"null\"\n"
      "[cameras.5]\ncam_id = 5\nsize = [2, 2]\nignore = true\n"
      "[cameras.6]\ncam_id = 6\nsize = [2, 2]\nmatrix = [[1, 0, 1], [0, 1, 1], [0, 0, 1]]\ndistortions = [0, 0, 0, 0, "
      "0]\n"
      "rotation = \"null\"\ntranslation = \"null\"\n";
  const Calibration calibration = read_text(kCaliscope + more);
  EXPECT_THAT(names_of(calibration), ElementsAre("0", "3"));
  EXPECT_THAT(calibration.notes, ElementsAre("1 of 5 cameras have no pose and were left out.",
                                             "1 of 5 cameras are marked \"ignore\" and were left out.",
                                             "1 of 5 cameras have no intrinsics and were left out."));
  const Calibration intrinsics = read_text(more);
  EXPECT_FALSE(intrinsics.has_poses);
  EXPECT_THAT(names_of(intrinsics), ElementsAre("6"));
}

TEST_F(Caliscope, ReadsTheSingleFileOfOlderVersions) {
  const std::string text =
      "camera_count = 1\n[charuco]\nunits = \"inch\"\nsquare_size_overide_cm = 5.4\n"
      "[cam_7]\nport = 7\nsize = [640, 480]\nrotation_count = 0\nmatrix = [[800, 0, 320], [0, 800, 240], [0, 0, 1]]\n"
      "distortions = [0.0, 0.0, 0.0, 0.0, 0.0]\ntranslation = [1.0, 2.0, 3.0]\nrotation = [0.0, 0.0, 0.0]\n";
  const Calibration calibration = read_text(text);
  EXPECT_TRUE(format_->recognises(source_of(files_.path("camera_array.toml"))));
  EXPECT_FALSE(make_toml_calibration()->recognises(source_of(files_.path("camera_array.toml"))));
  EXPECT_EQ(calibration.unit, "m");
  ASSERT_THAT(names_of(calibration), ElementsAre("7"));
  EXPECT_EQ(calibration.cameras[0].centre(), Eigen::Vector3d(-1, -2, -3));
}

TEST_F(Caliscope, NamesWhatIsMissingOrWrong) {
  EXPECT_THAT(refusal_of(replaced(kCaliscope, "distortions", "d")), HasSubstr("0.distortions is missing"));
  EXPECT_THAT(refusal_of(replaced(kCaliscope, "translation", "t")), HasSubstr("0.translation is missing"));
  EXPECT_THAT(refusal_of(replaced(kCaliscope, "640", "640.5")), HasSubstr("0.size"));
  EXPECT_THAT(refusal_of(replaced(kCaliscope, "-0.25", "inf")), HasSubstr("camera_array.toml:8: "));
  EXPECT_THAT(refusal_of(replaced(kCaliscope, "[1.0, 0.0, 0.0]", "[1.0, 0.0]")), HasSubstr("0.rotation has 8 numbers"));
  EXPECT_THAT(refusal_of("[cameras]\n"), HasSubstr("no camera"));
}

TEST_F(Caliscope, SurvivesHostileFiles) {
  support::expect_survives_hostile_files(files_.path("camera_array.toml"), kCaliscope,
                                         [&](const fs::path& path) { read(format_, path); });
}

// ------------------------------------------------------------------------------------------------------ all six
// formats

TEST(TextCalibrations, ClaimOnlyTheirOwnFiles) {
  std::vector<Format> formats;
  for (const auto make : {make_easymocap_calibration, make_opencv_stereo_calibration, make_ros_calibration,
                          make_kalibr_calibration, make_toml_calibration, make_caliscope_calibration})
    formats.push_back(make());
  const std::vector<std::pair<std::string, std::string>> files = {{"easymocap", kIntri},
                                                                  {"easymocap", kExtri},
                                                                  {"opencv_stereo", kStereoIntrinsics},
                                                                  {"opencv_stereo", kSingle},
                                                                  {"opencv_stereo", kStereoExtrinsics},
                                                                  {"ros_camera_info", kRos},
                                                                  {"kalibr", kCamchain},
                                                                  {"toml", kToml},
                                                                  {"caliscope", kCaliscope},
                                                                  {"", "{\"cameras\": []}"},
                                                                  {"", ""},
                                                                  {"", "<?xml version=\"1.0\"?><document/>"},
                                                                  {"", "Skeletool Camera Calibration File V1.0\n"},
                                                                  {"", std::string(1000, '\0')},
                                                                  {"", "[metadata]\nadjusted = false\n"},
                                                                  {"", "%YAML:1.0\n---\nunits: metres\n"}};
  for (const auto& [name, text] : files) {
    for (const std::string& head : {text, support::with_crlf(text)}) {
      for (const Format& format : formats)
        EXPECT_EQ(format->recognises({"any", head, false}), format->name() == name) << format->name() << "\n" << head;
    }
    for (std::size_t n = 0; n < text.size(); n += 7) {
      for (const Format& format : formats) EXPECT_NO_THROW(format->recognises({"any", text.substr(0, n), false}));
    }
  }
}

TEST(TextCalibrations, DoNotClaimOtherFolders) {
  Files files;
  EXPECT_FALSE(make_easymocap_calibration()->recognises(source_of(files.path())));
  files.write("intri.yml", "a: 1\n");
  EXPECT_FALSE(make_easymocap_calibration()->recognises(source_of(files.path())));
  EXPECT_FALSE(make_opencv_stereo_calibration()->recognises(source_of(files.path())));
}

}  // namespace
}  // namespace doppel::text_calibrations_test
