#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "calibration/formats/binary_writers.h"
#include "calibration/formats/source_of.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/pickle.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::binary_calibrations_test {
namespace {

using namespace support;  // binary_writers.h
using support::message_of;
using support::replaced;
using support::TemporaryFolder;
using support::write_bytes;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kTolerance = 1e-9;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Calibration read_with(const std::unique_ptr<CalibrationFormat>& format, const std::filesystem::path& path) {
  return format->read({path, "", std::filesystem::is_directory(path)});
}

Calibration read_colmap(const std::filesystem::path& path) { return read_with(make_colmap_calibration(), path); }
Calibration read_zju(const std::filesystem::path& path) { return read_with(make_zju_calibration(), path); }
Calibration read_opencap(const std::filesystem::path& path) { return read_with(make_opencap_calibration(), path); }

// COLMAP. The quaternion (0.5, 0.5, 0.5, 0.5) turns x to y, y to z and z to x, so that a camera sees the world point
// (a, b, c) at (c, a, b) + t.

constexpr const char* kCameras =
    "# Camera list\n"
    "12 SIMPLE_PINHOLE 640 480 500 320 240\n"
    "3 PINHOLE 640 480 500 510 321 241\n"
    "4 SIMPLE_RADIAL 640 480 500 320 240 -0.1\n"
    "5 RADIAL 640 480 500 320 240 -0.1 0.02\n"
    "6 OPENCV 640 480 500 510 321 241 -0.1 0.02 0.003 -0.004\n"
    "7 OPENCV_FISHEYE 640 480 500 510 321 241 -0.1 0.02 0.003 -0.004\n"
    "8 FULL_OPENCV 640 480 500 510 321 241 -0.1 0.02 0.003 -0.004 0.05 0.06 0.07 0.08\n";

constexpr const char* kImages =
    "# Image list\n"
    "70 0.5 0.5 0.5 0.5 0.1 0.2 3 12 a.png\n"
    "1.5 2.5 -1 3.5 4.5 17\n"
    "5 0.5 0.5 0.5 0.5 0.1 0.2 3 3 with a blank.jpg\n"
    "\n"
    "6 0.5 0.5 0.5 0.5 0.1 0.2 3 4 c.png\n"
    "\n"
    "7 0.5 0.5 0.5 0.5 0.1 0.2 3 5 d.png\n"
    "\n"
    "8 0.5 0.5 0.5 0.5 0.1 0.2 3 6 e.png\n"
    "\n"
    "9 0.5 0.5 0.5 0.5 0.1 0.2 3 7 f.png\n"
    "\n"
    "1 0.5 0.5 0.5 0.5 0.1 0.2 3 8 g.tar.png\n"
    "\n";

/// A model in a folder of its own.
class ColmapFolder {
 public:
  ColmapFolder& text(const std::string& cameras, const std::string& images) {
    write_bytes(folder_ / "cameras.txt", cameras);
    write_bytes(folder_ / "images.txt", images);
    return *this;
  }
  ColmapFolder& binary(const std::string& cameras, const std::string& images) {
    write_bytes(folder_ / "cameras.bin", cameras);
    write_bytes(folder_ / "images.bin", images);
    return *this;
  }
  Calibration read() const { return read_colmap(folder_.path()); }
  std::string refusal() const {
    return message_of<FileError>([&] { read(); });
  }
  std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }
  const std::filesystem::path& path() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
};

std::string refusal_of_text(const std::string& cameras, const std::string& images) {
  return ColmapFolder().text(cameras, images).refusal();
}

/// The pixel of the world point (0.3, -0.2, 0.5) in the cameras above: (0.5, 0.3, -0.2) + (0.1, 0.2, 3) in the camera.
Eigen::Vector2d pixel_of(double fx, double fy, double cx, double cy, const std::vector<double>& k, bool fisheye) {
  const double x = 0.6 / 2.8, y = 0.5 / 2.8, r2 = x * x + y * y;
  const auto at = [&](std::size_t i) { return i < k.size() ? k[i] : 0.0; };
  if (fisheye) {
    const double r = std::sqrt(r2), t = std::atan(r);
    const double turned =
        t + at(0) * std::pow(t, 3) + at(1) * std::pow(t, 5) + at(2) * std::pow(t, 7) + at(3) * std::pow(t, 9);
    return {fx * x * turned / r + cx, fy * y * turned / r + cy};
  }
  const double scale = (1 + at(0) * r2 + at(1) * std::pow(r2, 2) + at(4) * std::pow(r2, 3)) /
                       (1 + at(5) * r2 + at(6) * std::pow(r2, 2) + at(7) * std::pow(r2, 3));
  const double u = x * scale + 2 * at(2) * x * y + at(3) * (r2 + 2 * x * x);
  const double v = y * scale + at(2) * (r2 + 2 * y * y) + 2 * at(3) * x * y;
  return {fx * u + cx, fy * v + cy};
}

void expect_pixel(const Camera& camera, const Eigen::Vector2d& expected) {
  const Eigen::Vector2d pixel = camera.project({0.3, -0.2, 0.5});
  EXPECT_NEAR(pixel.x(), expected.x(), kTolerance) << camera.name;
  EXPECT_NEAR(pixel.y(), expected.y(), kTolerance) << camera.name;
}

void expect_seven_models(const std::vector<Camera>& cameras) {
  ASSERT_THAT(cameras, SizeIs(7));
  expect_pixel(cameras[0], pixel_of(500, 500, 320, 240, {}, false));
  expect_pixel(cameras[1], pixel_of(500, 510, 321, 241, {}, false));
  expect_pixel(cameras[2], pixel_of(500, 500, 320, 240, {-0.1}, false));
  expect_pixel(cameras[3], pixel_of(500, 500, 320, 240, {-0.1, 0.02}, false));
  const std::vector<double> four = {-0.1, 0.02, 0.003, -0.004};
  expect_pixel(cameras[4], pixel_of(500, 510, 321, 241, four, false));
  expect_pixel(cameras[5], pixel_of(500, 510, 321, 241, four, true));
  expect_pixel(cameras[6], pixel_of(500, 510, 321, 241, {-0.1, 0.02, 0.003, -0.004, 0.05, 0.06, 0.07, 0.08}, false));
  for (const Camera& camera : cameras) {
    EXPECT_EQ(camera.width, 640);
    EXPECT_EQ(camera.height, 480);
    EXPECT_THAT(camera.faults(), IsEmpty());
  }
}

TEST(ColmapCalibration, ReadsTheModelsOfTextFiles) {
  ColmapFolder folder;
  folder.text(kCameras, kImages);
  const Calibration calibration = folder.read();
  expect_seven_models(calibration.cameras);
  EXPECT_THAT(names_of(calibration), ElementsAre("a", "with a blank", "c", "d", "e", "f", "g.tar"));
  EXPECT_TRUE(calibration.has_poses);
  EXPECT_EQ(calibration.unit + calibration.up, "");
  EXPECT_THAT(calibration.notes, IsEmpty());
  // centre = -R^T t, and R^T (x, y, z) = (y, z, x)
  EXPECT_LT((calibration.cameras[0].centre() - Eigen::Vector3d(-0.2, -3, -0.1)).norm(), kTolerance);
}

TEST(ColmapCalibration, ReadsTheModelsOfBinaryFiles) {
  const std::vector<double> four = {500, 510, 321, 241, -0.1, 0.02, 0.003, -0.004};
  std::vector<double> eight = four;
  eight.insert(eight.end(), {0.05, 0.06, 0.07, 0.08});
  ColmapFolder folder;
  folder.binary(counted(7, binary_camera(6, 4, 640, 480, four) + binary_camera(0, 0, 640, 480, {500, 320, 240}) +
                               binary_camera(1, 1, 640, 480, {500, 510, 321, 241}) +
                               binary_camera(2, 2, 640, 480, {500, 320, 240, -0.1}) +
                               binary_camera(3, 3, 640, 480, {500, 320, 240, -0.1, 0.02}) +
                               binary_camera(5, 5, 640, 480, four) + binary_camera(9, 6, 640, 480, eight)),
                counted(7, binary_image(0, "a.png", 3) + binary_image(1, "with a blank.jpg") +
                               binary_image(2, "c.png", 1) + binary_image(3, "d.png") + binary_image(6, "e.png") +
                               binary_image(5, "f.png") + binary_image(9, "g.tar.png")));
  expect_seven_models(folder.read().cameras);
  EXPECT_THAT(names_of(folder.read()), ElementsAre("a", "with a blank", "c", "d", "e", "f", "g.tar"));
  for (const char* file : {"cameras.bin", "images.bin"}) expect_seven_models(read_colmap(folder / file).cameras);
}

TEST(ColmapCalibration, PrefersTheBinaryFilesOfAFolder) {
  ColmapFolder folder;
  folder.text("1 SIMPLE_PINHOLE 640 480 500 320 240\n", "1 1 0 0 0 0 0 0 1 a.png\n\n");
  folder.binary(counted(1, binary_camera(1, 0, 640, 480, {600, 320, 240})), counted(1, binary_image(1, "a.png")));
  EXPECT_EQ(folder.read().cameras.at(0).K(0, 0), 600);
  EXPECT_EQ(read_colmap(folder / "images.txt").cameras.at(0).K(0, 0), 500);
  std::filesystem::remove(folder / "images.bin");
  EXPECT_EQ(folder.read().cameras.at(0).K(0, 0), 500);
}

constexpr const char* kLens = "1 SIMPLE_PINHOLE 640 480 500 320 240\n2 SIMPLE_PINHOLE 640 480 501 320 240\n";

TEST(ColmapCalibration, TakesOneCameraForAFolderWhoseImagesShareAPose) {
  const std::string images =
      "1 1 0 0 0 1 2 3 2 rig/left/0001.jpg\n\n"
      "2 1 0 0 0 4 5 6 1 rig/right/0001.jpg\n\n"
      "3 1 0 0 0 1 2.0000001 3 2 rig/left/0002.jpg\n\n"
      "4 -1 0 0 0 4 5 6 1 rig/right/0002.jpg\n\n";
  ColmapFolder folder;
  folder.text(kLens, images);
  const Calibration calibration = folder.read();
  EXPECT_THAT(names_of(calibration), ElementsAre("rig/left", "rig/right"));
  EXPECT_EQ(calibration.cameras[0].K(0, 0), 501);
  ASSERT_THAT(calibration.notes, SizeIs(1));
  EXPECT_THAT(calibration.notes[0], HasSubstr("4 images, 2 cameras"));

  folder.text(kLens, replaced(images, "2.0000001", "2.001"));
  EXPECT_THAT(names_of(folder.read()),
              ElementsAre("rig/left/0001", "rig/right/0001", "rig/left/0002", "rig/right/0002"));
  EXPECT_THAT(folder.read().notes, IsEmpty());
  folder.text(kLens, replaced(images, "1 rig/right/0002.jpg", "2 rig/right/0002.jpg"));
  EXPECT_THAT(folder.read().cameras, SizeIs(4)) << "another lens";
  folder.text(kLens, images + "5 1 0 0 0 7 8 9 1 alone.jpg\n\n");
  EXPECT_THAT(folder.read().cameras, SizeIs(5)) << "an image without a folder";
}

TEST(ColmapCalibration, KeepsExtensionsThatTellNamesApart) {
  ColmapFolder folder;
  folder.text(kLens, "1 1 0 0 0 1 2 3 2 a.jpg\n\n2 1 0 0 0 4 5 6 1 a.png\n\n3 1 0 0 0 4 5 6 1 dir.d/b\n\n");
  EXPECT_THAT(names_of(folder.read()), ElementsAre("a.jpg", "a.png", "dir.d/b"));
}

TEST(ColmapCalibration, RadialFisheyeLensesHaveOneOrTwoCoefficients) {
  ColmapFolder folder;
  folder.text(
      "1 SIMPLE_RADIAL_FISHEYE 640 480 500 320 240 -0.1\n"
      "2 RADIAL_FISHEYE 640 480 500 320 240 -0.1 0.02\n",
      "1 1 0 0 0 1 2 3 1 a.jpg\n\n2 1 0 0 0 4 5 6 2 b.jpg\n\n");
  const std::vector<Camera> cameras = folder.read().cameras;
  ASSERT_THAT(cameras, SizeIs(2));
  for (const Camera& camera : cameras) {
    EXPECT_EQ(camera.lens, Lens::fisheye);
    EXPECT_EQ(camera.K(0, 0), 500.0);
    EXPECT_EQ(camera.K(1, 1), 500.0);
    EXPECT_EQ(camera.K(0, 2), 320.0);
    EXPECT_EQ(camera.distortion[0], -0.1);
  }
  EXPECT_EQ(cameras[0].distortion[1], 0.0);
  EXPECT_EQ(cameras[1].distortion[1], 0.02);
  // COLMAP: u = theta (1 + k1 theta^2 + k2 theta^4) in the direction of the point.
  const double theta = std::atan(0.5), moved = theta * (1.0 - 0.1 * theta * theta + 0.02 * std::pow(theta, 4));
  EXPECT_NEAR(cameras[1].distorted({0.5, 0.0}).x(), moved, 1e-12);
}

TEST(ColmapCalibration, RefusesOtherLensModelsByName) {
  const std::string image = "1 1 0 0 0 1 2 3 1 a.jpg\n\n";
  EXPECT_THAT(refusal_of_text("1 FOV 640 480 500 500 320 240 0.9\n", image),
              AllOf(HasSubstr("cameras.txt:1"), HasSubstr("FOV"), HasSubstr("OPENCV_FISHEYE")));
  EXPECT_THAT(refusal_of_text("1 MY_MODEL 640 480 500\n", image), HasSubstr("MY_MODEL"));
  ColmapFolder folder;
  const std::string thin_prism = binary_camera(1, 10, 640, 480, std::vector<double>(12, 1.0));
  folder.binary(counted(1, thin_prism), counted(1, binary_image(1, "a.png")));
  EXPECT_THAT(folder.refusal(), AllOf(HasSubstr("cameras.bin"), HasSubstr("THIN_PRISM_FISHEYE")));
  folder.binary(counted(1, binary_camera(1, 99, 640, 480, {1})), counted(1, binary_image(1, "a.png")));
  EXPECT_THAT(folder.refusal(), HasSubstr("99"));
  // A camera that no image uses does no harm.
  folder.binary(counted(2, thin_prism + binary_camera(2, 0, 640, 480, {500, 320, 240})),
                counted(1, binary_image(2, "a.png")));
  EXPECT_THAT(folder.read().cameras, SizeIs(1));
}

TEST(ColmapCalibration, NamesTheFaultsOfTextFiles) {
  const std::string lens = "1 SIMPLE_PINHOLE 640 480 500 320 240\n", image = "1 1 0 0 0 1 2 3 1 a.jpg\n\n";
  EXPECT_THAT(refusal_of_text(lens, "1 1 0 0 0 1 2 3 8 a.jpg\n\n"),
              AllOf(HasSubstr("images.txt:1"), HasSubstr("camera 8"), HasSubstr("cameras.txt")));
  EXPECT_THAT(refusal_of_text(lens, "1 1 0 0 0 1 2 3 1\n\n"), HasSubstr("found 9 items"));
  EXPECT_THAT(refusal_of_text(lens, "1 1 0 0 0 1 nan 3 1 a.jpg\n\n"), HasSubstr("\"nan\""));
  EXPECT_THAT(refusal_of_text(lens, "1 0 0 0 0 1 2 3 1 a.jpg\n\n"), HasSubstr("quaternion"));
  EXPECT_THAT(refusal_of_text(lens, "# nothing\n"), HasSubstr("no image"));
  // Without the second lines, every second image would be lost.
  EXPECT_THAT(refusal_of_text(lens, "1 1 0 0 0 1 2 3 1 a.jpg\n2 1 0 0 0 1 2 3 1 b.jpg\n"),
              AllOf(HasSubstr("images.txt:2"), HasSubstr("second line")));
  EXPECT_THAT(refusal_of_text("1 OPENCV 640 480 500 320 240\n", image),
              AllOf(HasSubstr("cameras.txt:1"), HasSubstr("3 parameters, OPENCV has 8")));
  EXPECT_THAT(refusal_of_text("1 SIMPLE_PINHOLE 0 480 500 320 240\n", image), HasSubstr("0x480"));
  EXPECT_THAT(refusal_of_text("1 SIMPLE_PINHOLE 640 99999999 500 320 240\n", image), HasSubstr("99999999"));
  EXPECT_THAT(refusal_of_text(lens + lens, image), HasSubstr("second camera"));
  EXPECT_THAT(refusal_of_text(lens + std::string(1, '\0'), image), HasSubstr("NUL"));
}

TEST(ColmapCalibration, ChecksCountsBeforeItAllocates) {
  const std::string lens = counted(1, binary_camera(1, 0, 640, 480, {500, 320, 240}));
  const std::string image = counted(1, binary_image(1, "a.png", 2));
  const auto refusal = [](const std::string& cameras, const std::string& images) {
    return ColmapFolder().binary(cameras, images).refusal();
  };
  const std::uint64_t huge = std::uint64_t{1} << 62;
  EXPECT_THAT(refusal(little_endian(huge) + lens.substr(8), image),
              AllOf(HasSubstr("cameras.bin"), HasSubstr("4611686018427387904 cameras")));
  EXPECT_THAT(refusal(lens, little_endian(huge) + image.substr(8)), HasSubstr("4611686018427387904 images"));
  const std::string no_points = image.substr(0, image.size() - 2 * 24 - 8);
  EXPECT_THAT(refusal(lens, no_points + little_endian(huge) + std::string(48, 'x')), HasSubstr("points of an image"));
  EXPECT_THAT(refusal(lens, counted(1, std::string(200, 'x'))), HasSubstr("no end"));
  EXPECT_THAT(refusal(lens, counted(1, binary_image(1, ""))), HasSubstr("empty name"));
  EXPECT_THAT(refusal(lens + "x", image), HasSubstr("1 bytes follow"));
  EXPECT_THAT(refusal(lens.substr(0, lens.size() - 1), image), HasSubstr("truncated"));
  EXPECT_THAT(refusal(counted(1, binary_camera(1, 0, 640, 480, {500, kNan, 240})), image), HasSubstr("finite"));
}

TEST(ColmapCalibration, RecognisesItsFilesByTheirContent) {
  const auto format = make_colmap_calibration();
  ColmapFolder folder;
  folder.text(kCameras, kImages);
  EXPECT_TRUE(format->recognises(source_of(folder.path())));
  for (const char* file : {"cameras.txt", "images.txt"}) EXPECT_TRUE(format->recognises(source_of(folder / file)));
  folder.binary(counted(1, binary_camera(1, 0, 640, 480, {500, 320, 240})), counted(1, binary_image(1, "a.png")));
  EXPECT_TRUE(format->recognises(source_of(folder.path())));
  for (const char* file : {"cameras.bin", "images.bin"}) EXPECT_TRUE(format->recognises(source_of(folder / file)));

  for (const char* file : {"cameras.txt", "images.txt", "cameras.bin", "images.bin"}) {
    for (const std::string content : {"", "{\"cameras\": []}", "name,w,h\na,1,2\n", "%YAML:1.0\n---\n", "\x80\x04}."}) {
      EXPECT_FALSE(format->recognises({folder / file, content, false})) << file << ": " << content;
      EXPECT_FALSE(format->recognises({folder / file, content + std::string(200, 'x'), false})) << file << content;
    }
  }
  EXPECT_FALSE(format->recognises({folder / "other.txt", kCameras, false}));
  const TemporaryFolder empty;
  EXPECT_FALSE(format->recognises(source_of(empty.path())));
}

/// Four cameras with as many digits as a double has.
std::vector<Camera> cameras_to_write() {
  std::vector<Camera> cameras(4);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    Camera& camera = cameras[i];
    camera.name = "cam" + std::to_string(i);
    camera.width = 1000 + static_cast<int>(i);
    camera.height = 800;
    camera.K << 900 + 1.0 / 3, 0, 500.1, 0, 901.7, 400.7, 0, 0, 1;
    camera.R =
        Eigen::AngleAxisd(1.0 + static_cast<double>(i), Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    camera.t = {0.1, -1.0 / 3, 3.7};
  }
  cameras[1].distortion = {-0.1, 0.2 / 3, 0.001, 0.002};
  cameras[2].distortion = {-0.1, 0.2 / 3, 0.001, 0.002, 0.03, 0.1, 0.2, 0.3};
  cameras[3].lens = Lens::fisheye;
  cameras[3].distortion = {0.01, 0.02, 0.03, 1.0 / 7};
  return cameras;
}

TEST(ColmapCalibration, WritesWhatItReads) {
  const auto format = make_colmap_calibration();
  EXPECT_TRUE(format->can_write() && format->writes_folder());
  const TemporaryFolder folder;
  const std::vector<Camera> cameras = cameras_to_write();
  format->write(folder.path(), cameras);
  EXPECT_TRUE(format->recognises(source_of(folder.path())));
  const std::vector<Camera> again = read_colmap(folder.path()).cameras;
  ASSERT_EQ(again.size(), cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    EXPECT_EQ(again[i].name, cameras[i].name);
    EXPECT_EQ(again[i].width, cameras[i].width);
    EXPECT_EQ(again[i].K, cameras[i].K);
    EXPECT_EQ(again[i].lens, cameras[i].lens);
    EXPECT_EQ(again[i].distortion, cameras[i].distortion);
    EXPECT_LT((again[i].R - cameras[i].R).norm(), 1e-14);
    EXPECT_EQ(again[i].t, cameras[i].t);
  }
}

TEST(ColmapCalibration, WritesAnEmptySecondLineForEveryImage) {
  const TemporaryFolder folder;
  std::vector<Camera> cameras = {cameras_to_write()[0]};
  cameras[0].R.setIdentity();
  cameras[0].t = {1, 2, 3};
  make_colmap_calibration()->write(folder.path(), cameras);
  EXPECT_THAT(read_file(folder / "images.txt"), HasSubstr("NAME\n1 1 0 0 0 1 2 3 1 cam0.png\n\n"));
  EXPECT_THAT(read_file(folder / "cameras.txt"),
              HasSubstr("\n1 PINHOLE 1000 800 900.33333333333337 901.70000000000005 "));
  EXPECT_TRUE(std::filesystem::exists(folder / "points3D.txt"));
}

TEST(ColmapCalibration, RefusesToWriteWhatColmapCannotHold) {
  const TemporaryFolder folder;
  const auto refusal = [&](const auto& change) {
    Camera camera = cameras_to_write()[1];
    change(camera);
    return message_of<Error>([&] { make_colmap_calibration()->write(folder.path(), {camera}); });
  };
  EXPECT_THAT(refusal([](Camera& c) { c.lens = Lens::polynomial; }), HasSubstr("polynomial"));
  EXPECT_THAT(refusal([](Camera& c) { c.distortion[9] = 0.1; }), HasSubstr("thin prism"));
  EXPECT_THAT(refusal([](Camera& c) { c.distortion[13] = 0.1; }), HasSubstr("tilt"));
  EXPECT_THAT(refusal([](Camera& c) { c.K(0, 1) = 0.1; }), HasSubstr("skew"));
  EXPECT_THAT(refusal([](Camera& c) { c.width = 0; }), HasSubstr("no image size"));
  EXPECT_THAT(refusal([](Camera& c) { c.name = "cam 1"; }), HasSubstr("one word"));
}

TEST(ColmapCalibration, SurvivesHostileFiles) {
  ColmapFolder text, binary;
  text.text(kCameras, kImages);
  const std::string lens = counted(1, binary_camera(1, 4, 640, 480, {500, 510, 320, 240, 0.1, 0.2, 0.3, 0.4}));
  const std::string images = counted(2, binary_image(1, "a.png", 2) + binary_image(1, "b.png"));
  support::expect_survives_hostile_files(text / "cameras.txt", kCameras, read_colmap);
  text.text(kCameras, kImages);
  support::expect_survives_hostile_files(text / "images.txt", kImages, read_colmap);
  binary.binary(lens, images);
  support::expect_survives_hostile_files(binary / "cameras.bin", lens, read_colmap);
  binary.binary(lens, images);
  support::expect_survives_hostile_files(binary / "images.bin", images, read_colmap);
}

// Pickles. The four below hold the same dict, written by numpy:
// {"a": [[1.5, -2], [3, 250]], "f": the transpose of [[1, 2], [3, 4], [5, 6]], "n": -7, "s": "k\u00e4se\n",
//  "x": numpy.float32(0.25), "l": [1, (2, 3.5)]}

constexpr char kProtocol0[] =
    "(dVa\012cnumpy.core.multiarray\012_reconstruct\012p0\012(cnumpy\012ndarray\012p1\012(I0\012tc_codecs\012enco"
    "de\012p2\012(Vb\012Vlatin1\012p3\012tRp4\012tR(I1\012(I2\012I2\012tcnumpy\012dtype\012p5\012(Vf8\012I00\012I"
    "01\012tRp6\012(I3\012V<\012p7\012NNNI-1\012I-1\012I0\012tbI00\012g2\012(V\\u0000\\u0000\\u0000\\u0000\\u0000"
    "\\u0000\370\077\\u0000\\u0000\\u0000\\u0000\\u0000\\u0000\\u0000\300\\u0000\\u0000\\u0000\\u0000\\u0000\\u00"
    "00\010@\\u0000\\u0000\\u0000\\u0000\\u0000@o@\012g3\012tRtbsVf\012g0\012(g1\012(I0\012tg4\012tR(I1\012(I2"
    "\012I3\012tg6\012I01\012g2\012(V\\u0000\\u0000\\u0000\\u0000\\u0000\\u0000\360\077\\u0000\\u0000\\u0000\\u00"
    "00\\u0000\\u0000\\u0000@\\u0000\\u0000\\u0000\\u0000\\u0000\\u0000\010@\\u0000\\u0000\\u0000\\u0000\\u0000\\"
    "u0000\020@\\u0000\\u0000\\u0000\\u0000\\u0000\\u0000\024@\\u0000\\u0000\\u0000\\u0000\\u0000\\u0000\030@\012"
    "g3\012tRtbsVn\012I-7\012sVs\012Vk\344se\\u000a\012sVx\012cnumpy.core.multiarray\012scalar\012(g5\012(Vf4\012"
    "I00\012I01\012tR(I3\012g7\012NNNI-1\012I-1\012I0\012tbg2\012(V\\u0000\\u0000\200>\012g3\012tRtRsVl\012(lI1"
    "\012a(I2\012F3.5\012tas.";

constexpr char kProtocol2[] =
    "\200\002}(X\001\000\000\000acnumpy.core.multiarray\012_reconstruct\012q\000cnumpy\012ndarray\012q\001K\000"
    "\205c_codecs\012encode\012q\002X\001\000\000\000bX\006\000\000\000latin1q\003\206Rq\004\207R(K\001K\002K\002"
    "\206cnumpy\012dtype\012q\005X\002\000\000\000f8\211\210\207Rq\006(K\003X\001\000\000\000<q\007NNNJ\377\377"
    "\377\377J\377\377\377\377K\000tb\211h\002X\"\000\000\000\000\000\000\000\000\000\303\270\077\000\000\000\000"
    "\000\000\000\303\200\000\000\000\000\000\000\010@\000\000\000\000\000@o@h\003\206RtbX\001\000\000\000fh\000h"
    "\001K\000\205h\004\207R(K\001K\002K\003\206h\006\210h\002X1\000\000\000\000\000\000\000\000\000\303\260\077"
    "\000\000\000\000\000\000\000@\000\000\000\000\000\000\010@\000\000\000\000\000\000\020@\000\000\000\000\000"
    "\000\024@\000\000\000\000\000\000\030@h\003\206RtbX\001\000\000\000nJ\371\377\377\377X\001\000\000\000sX\006"
    "\000\000\000k\303\244se\012X\001\000\000\000xcnumpy.core.multiarray\012scalar\012h\005X\002\000\000\000f4"
    "\211\210\207R(K\003h\007NNNJ\377\377\377\377J\377\377\377\377K\000tbh\002X\005\000\000\000\000\000\302\200>h"
    "\003\206R\206RX\001\000\000\000l](K\001K\002G@\014\000\000\000\000\000\000\206eu.";

constexpr char kProtocol4[] =
    "\200\004\225s\001\000\000\000\000\000\000}\224(\214\001a\224\214\025numpy.core.multiarray\224\214\014_recons"
    "truct\224\223\224\214\005numpy\224\214\007ndarray\224\223\224K\000\205\224C\001b\224\207\224R\224(K\001K\002"
    "K\002\206\224h\005\214\005dtype\224\223\224\214\002f8\224\211\210\207\224R\224(K\003\214\001<\224NNNJ\377"
    "\377\377\377J\377\377\377\377K\000t\224b\211C \000\000\000\000\000\000\370\077\000\000\000\000\000\000\000"
    "\300\000\000\000\000\000\000\010@\000\000\000\000\000@o@\224t\224b\214\001f\224h\004h\007K\000\205\224h\011"
    "\207\224R\224(K\001K\002K\003\206\224h\021\210C0\000\000\000\000\000\000\360\077\000\000\000\000\000\000\000"
    "@\000\000\000\000\000\000\010@\000\000\000\000\000\000\020@\000\000\000\000\000\000\024@\000\000\000\000\000"
    "\000\030@\224t\224b\214\001n\224J\371\377\377\377\214\001s\224\214\006k\303\244se\012\224\214\001x\224h\002"
    "\214\006scalar\224\223\224h\016\214\002f4\224\211\210\207\224R\224(K\003h\022NNNJ\377\377\377\377J\377\377"
    "\377\377K\000t\224bC\004\000\000\200>\224\206\224R\224\214\001l\224]\224(K\001K\002G@\014\000\000\000\000"
    "\000\000\206\224eu.";

constexpr char kProtocol5[] =
    "\200\005\225L\001\000\000\000\000\000\000}(\214\001a\214\022numpy.core.numeric\214\013_frombuffer\223\224("
    "\226 \000\000\000\000\000\000\000\000\000\000\000\000\000\370\077\000\000\000\000\000\000\000\300\000\000"
    "\000\000\000\000\010@\000\000\000\000\000@o@\214\005numpy\214\005dtype\223\224\214\002f8\211\210\207R\224(K"
    "\003\214\001<\224NNNJ\377\377\377\377J\377\377\377\377K\000tbK\002K\002\206\214\001CtR\214\001fh\000(\2260"
    "\000\000\000\000\000\000\000\000\000\000\000\000\000\360\077\000\000\000\000\000\000\000@\000\000\000\000"
    "\000\000\010@\000\000\000\000\000\000\020@\000\000\000\000\000\000\024@\000\000\000\000\000\000\030@h\002K"
    "\002K\003\206\214\001FtR\214\001nJ\371\377\377\377\214\001s\214\006k\303\244se\012\214\001x\214\025numpy.cor"
    "e.multiarray\214\006scalar\223h\001\214\002f4\211\210\207R(K\003h\003NNNJ\377\377\377\377J\377\377\377\377K"
    "\000tbC\004\000\000\200>\206R\214\001l](K\001K\002G@\014\000\000\000\000\000\000\206eu.";

const FileLocation kWhere{"test.pickle", 0};

template <std::size_t size>
std::string bytes_of(const char (&literal)[size]) {
  return {literal, size - 1};
}

std::vector<double> numbers_at(const Pickle& pickle, const char* key) {
  return numbers(entry(pickle.root, key, "the test", kWhere), 0, key, kWhere);
}

std::string refusal_of_pickle(const std::string& bytes) {
  return message_of<FileError>([&] { read_pickle(bytes, kWhere); });
}

void expect_the_dict_of_numpy(const std::string& bytes) {
  const Pickle pickle = read_pickle(bytes, kWhere);
  EXPECT_THAT(numbers_at(pickle, "a"), ElementsAre(1.5, -2, 3, 250));
  // The transpose is stored column by column.
  EXPECT_THAT(numbers_at(pickle, "f"), ElementsAre(1, 3, 5, 2, 4, 6));
  EXPECT_THAT(entry(pickle.root, "f", "", kWhere).shape().value(), ElementsAre(2, 3));
  EXPECT_THAT(numbers_at(pickle, "n"), ElementsAre(-7));
  EXPECT_THAT(numbers_at(pickle, "x"), ElementsAre(0.25));
  EXPECT_THAT(numbers_at(pickle, "l"), ElementsAre(1, 2, 3.5));
  EXPECT_EQ(entry(pickle.root, "s", "", kWhere).text(), "k\xC3\xA4se\n");
  EXPECT_FALSE(pickle.root.find("other"));
}

TEST(Pickle, ReadsTheProtocolsOfPython) {
  expect_the_dict_of_numpy(bytes_of(kProtocol0));
  expect_the_dict_of_numpy(bytes_of(kProtocol2));
  expect_the_dict_of_numpy(bytes_of(kProtocol4));
  expect_the_dict_of_numpy(bytes_of(kProtocol5));
}

TEST(Pickle, KnowsTheNewNameOfNumpyCore) {
  std::string bytes = bytes_of(kProtocol2);
  for (std::size_t at = bytes.find("numpy.core."); at != std::string::npos; at = bytes.find("numpy.core."))
    bytes.replace(at, 11, "numpy._core.");
  expect_the_dict_of_numpy(bytes);
}

std::vector<double> numbers_of(const std::string& value) {
  const Pickle pickle = read_pickle(pickled(value), kWhere);
  return numbers(pickle.root, 0, "the value", kWhere);
}
std::string refusal_of_numbers(const std::string& value) {
  return message_of<FileError>([&] { numbers_of(value); });
}

TEST(Pickle, ReadsTheTypesOfNumbers) {
  const auto array = [](const std::string& type, const std::string& order, const std::string& data, int size) {
    return numbers_of(py_array({size}, py_dtype(type, order), py_bytes(data)));
  };
  EXPECT_THAT(array("f4", "<", little_endian(0.5f) + little_endian(-2.f), 2), ElementsAre(0.5, -2));
  EXPECT_THAT(array("f8", ">", std::string("\x3f\xf8\0\0\0\0\0\0", 8), 1), ElementsAre(1.5));
  EXPECT_THAT(array("i2", ">", std::string("\xff\xfe", 2), 1), ElementsAre(-2));
  EXPECT_THAT(array("i8", "<", little_endian(std::int64_t{-3}), 1), ElementsAre(-3));
  EXPECT_THAT(array("u1", "|", "\x01\xff", 2), ElementsAre(1, 255));
  EXPECT_THAT(array("b1", "|", std::string("\x01\0", 2), 2), ElementsAre(1, 0));
  EXPECT_THAT(numbers_of(py_array({2}, py_dtype("O8", "|"), py_list({py_int(4), "K\5"}))), ElementsAre(4, 5));
  EXPECT_THAT(numbers_of("\x8a\2\xff\xfe"), ElementsAre(-257));
  EXPECT_THAT(numbers_of(std::string("\x8a\0", 2)), ElementsAre(0));
  EXPECT_THAT(numbers_of("I01\n"), ElementsAre(1));
  EXPECT_THAT(numbers_of("L12L\n"), ElementsAre(12));
  // A text of Python 2 with escapes.
  EXPECT_EQ(read_pickle("S'a\\x41\\n\\\\'\n.", kWhere).root.text(), "aA\n\\");
}

TEST(Pickle, RefusesEveryOtherNameAndObject) {
  EXPECT_THAT(refusal_of_pickle("cos\nsystem\n(Vecho\ntR."), AllOf(HasSubstr("test.pickle"), HasSubstr("os.system")));
  EXPECT_THAT(refusal_of_pickle(pickled("\x8c\5posix\x8c\6system\x93)R")), HasSubstr("posix.system"));
  EXPECT_THAT(refusal_of_pickle(pickled("cbuiltins\neval\n")), HasSubstr("builtins.eval"));
  EXPECT_THAT(refusal_of_pickle(pickled("cnumpy\nload\n")), HasSubstr("numpy.load"));
  EXPECT_THAT(refusal_of_pickle("(ios\nsystem\n."), HasSubstr("os.system"));
  EXPECT_THAT(refusal_of_pickle(pickled("cnumpy\nndarray\n)\x81")), HasSubstr("NEWOBJ"));
  EXPECT_THAT(refusal_of_pickle(pickled("cnumpy\nndarray\n)R")), HasSubstr("calls numpy.ndarray"));
  EXPECT_THAT(refusal_of_pickle(pickled("K\1)R")), HasSubstr("calls a number"));
  EXPECT_THAT(refusal_of_pickle(pickled("}}b")), HasSubstr("sets the state of a dict"));
  EXPECT_THAT(refusal_of_pickle("Pname\n."), HasSubstr("PERSID"));
  EXPECT_THAT(refusal_of_pickle(pickled("\x82\1")), HasSubstr("EXT"));
  EXPECT_THAT(refusal_of_pickle(pickled("\x8f")), HasSubstr("set"));
  EXPECT_THAT(refusal_of_pickle(pickled("\xfe")), HasSubstr("0xfe"));
  EXPECT_THAT(refusal_of_pickle("\x80\x09N."), HasSubstr("protocol 9"));
  EXPECT_THAT(refusal_of_pickle(pickled("c_codecs\nencode\n" + py_tuple({py_text("x"), py_text("rot13")}) + "R")),
              HasSubstr("rot13"));
}

TEST(Pickle, RefusesDamage) {
  EXPECT_THAT(refusal_of_pickle(""), HasSubstr("truncated"));
  EXPECT_THAT(refusal_of_pickle("."), HasSubstr("value is missing"));
  EXPECT_THAT(refusal_of_pickle(pickled("h\3")), HasSubstr("memo"));
  EXPECT_THAT(refusal_of_pickle(pickled("t")), HasSubstr("mark is missing"));
  EXPECT_THAT(refusal_of_pickle(pickled("](0")), HasSubstr("value is missing")) << "a value below the mark";
  EXPECT_THAT(refusal_of_pickle(pickled("K\1K\2a")), HasSubstr("added to a number"));
  EXPECT_THAT(refusal_of_pickle(pickled("}(K\1u")), HasSubstr("key without a value"));
  EXPECT_THAT(refusal_of_pickle(pickled("Ione\n")), HasSubstr("\"one\""));
  EXPECT_THAT(refusal_of_pickle("V\\u12\n."), HasSubstr("damaged"));
  EXPECT_THAT(refusal_of_pickle(pickled(std::string("\x8e\xff\xff\xff\xff\xff\xff\xff\x7f", 9))),
              HasSubstr("9223372036854775807 bytes"));
  const std::string eight = py_bytes("12345678");
  EXPECT_THAT(refusal_of_numbers(py_array({2}, py_dtype("f8", "<"), eight)), HasSubstr("needs 16 bytes, found 8"));
  EXPECT_THAT(refusal_of_numbers(py_array({-1}, py_dtype("f8", "<"), eight)), HasSubstr("damaged"));
  EXPECT_THAT(refusal_of_numbers(py_array({1}, py_dtype("U2", "<"), eight)), HasSubstr("\"U2\""));
  EXPECT_THAT(refusal_of_numbers(py_array({1}, "N", eight)), HasSubstr("holds no numbers"));
  EXPECT_THAT(refusal_of_numbers(py_array({1 << 15, 1 << 15}, py_dtype("f8", "<"), eight)), HasSubstr("too many"));
  EXPECT_THAT(refusal_of_numbers(py_matrix({1}, {kNan})), HasSubstr("finite"));
  EXPECT_THAT(refusal_of_numbers(py_text("word")), HasSubstr("found a text"));
}

TEST(Pickle, BoundsWhatASmallFileCanMean) {
  std::string nested = "]K\1a";
  for (int i = 0; i < 60; ++i) nested = "](" + nested + "q\1h\1e";
  EXPECT_THAT(refusal_of_numbers(nested), HasSubstr("nested too deeply"));
  EXPECT_THAT(refusal_of_numbers("]q\1h\1a"), HasSubstr("nested too deeply")) << "a list that holds itself";
  EXPECT_THAT(refusal_of_pickle(std::string(5000, '(') + "."), HasSubstr("nested"));
  EXPECT_THAT(refusal_of_pickle(std::string(5'000'000, ']') + "."), HasSubstr("4000000"));
  std::string encoded =
      "c_codecs\nencode\nq\1" + py_text(std::string(100'000, 'a')) + "q\2" + py_text("latin1") + "q\3";
  for (int i = 0; i < 10'000; ++i) encoded += "h\1h\2h\3\x86R";
  EXPECT_THAT(refusal_of_pickle(encoded + "."), HasSubstr("more text than it holds"));
  // A tuple that grows after it became the shape of an array.
  const std::string axes = py_list({py_int(1)}) + "q\1";
  const std::string state = py_tuple({py_int(1), axes, py_dtype("f8", "<"), "\x89", py_bytes("12345678")});
  const std::string array =
      "cnumpy.core.multiarray\n_reconstruct\n" + py_tuple({"cnumpy\nndarray\n"}) + "R" + state + "b";
  EXPECT_THAT(refusal_of_numbers(array + "h\1K\7a0"), HasSubstr("needs 56 bytes, found 8"));
}

// OpenCap. The world is turned by 90 degrees about x: (a, b, c) is seen at (a, -c, b) + t.

class OpenCapFile {
 public:
  explicit OpenCapFile(const std::string& content) {
    std::filesystem::create_directories(path().parent_path());
    write_bytes(path(), content);
  }
  std::filesystem::path path() const { return folder_ / "Cam3/cameraIntrinsicsExtrinsics.pickle"; }
  Calibration read() const { return read_opencap(path()); }
  std::string refusal() const {
    return message_of<FileError>([&] { read(); });
  }

 private:
  TemporaryFolder folder_;
};

TEST(OpenCapCalibration, ReadsIntrinsics) {
  const Calibration calibration = OpenCapFile(opencap_dict()).read();
  EXPECT_FALSE(calibration.has_poses);
  ASSERT_THAT(calibration.cameras, SizeIs(1));
  const Camera& camera = calibration.cameras[0];
  EXPECT_EQ(camera.name, "Cam3");
  EXPECT_EQ(camera.width, 720) << "the size in the file is (height, width)";
  EXPECT_EQ(camera.height, 1280);
  EXPECT_EQ(camera.K(0, 2), 360.5) << "pixel centres at integers";
  EXPECT_EQ(camera.K(1, 2), 640.5);
  EXPECT_EQ(camera.distortion[4], 0.05);
}

TEST(OpenCapCalibration, ReadsThePoseInMillimetres) {
  const Calibration calibration = OpenCapFile(opencap_dict(opencap_pose())).read();
  EXPECT_TRUE(calibration.has_poses);
  EXPECT_EQ(calibration.unit, "mm");
  EXPECT_EQ(calibration.up, "") << "the board stands upright, but may be turned";
  const Camera& camera = calibration.cameras.at(0);
  // (0.2, 0.6, -0.1) is at (0.2, 0.1, 0.6) + (0.1, 0.2, 3).
  const double x = 0.3 / 3.6, y = 0.3 / 3.6, r2 = x * x + y * y;
  const double radial = 1 + 0.1 * r2 - 0.2 * r2 * r2 + 0.05 * r2 * r2 * r2;
  const double u = 900 * (x * radial + 2 * 0.001 * x * y + 0.002 * (r2 + 2 * x * x)) + 360.5;
  const double v = 905 * (y * radial + 0.001 * (r2 + 2 * y * y) + 2 * 0.002 * x * y) + 640.5;
  EXPECT_LT((camera.project({0.2, 0.6, -0.1}) - Eigen::Vector2d(u, v)).norm(), kTolerance);
  // centre = -R^T t, and R^T (x, y, z) = (x, z, -y)
  EXPECT_LT((camera.centre() - Eigen::Vector3d(-0.1, -3, 0.2)).norm(), kTolerance);
}

TEST(OpenCapCalibration, NamesWhatIsMissing) {
  const std::string without = pickled(py_dict({{"intrinsicMat", py_matrix({3, 3}, std::vector<double>(9, 1))}}));
  EXPECT_THAT(OpenCapFile(without).refusal(), AllOf(HasSubstr("Extrinsics.pickle"), HasSubstr("\"distortion\"")));
  EXPECT_THAT(OpenCapFile(opencap_dict({opencap_pose()[0]})).refusal(), HasSubstr("\"translation\""));
  EXPECT_THAT(OpenCapFile(opencap_dict({{"imageSize", py_matrix({2}, {0.5, 720})}})).refusal(), HasSubstr("imageSize"));
  EXPECT_THAT(OpenCapFile(opencap_dict({{"distortion", py_matrix({3}, {1, 2, 3})}})).refusal(),
              HasSubstr("3 coefficients"));
  EXPECT_THAT(OpenCapFile(opencap_dict({{"intrinsicMat", py_matrix({2, 2}, {1, 0, 0, 1})}})).refusal(),
              HasSubstr("intrinsicMat has 4 numbers, expected 9"));
  EXPECT_THAT(OpenCapFile(pickled("K\1")).refusal(), HasSubstr("must be a dict"));
  EXPECT_THAT(OpenCapFile(opencap_dict({{"x", "cposix\nsystem\n"}})).refusal(), HasSubstr("posix.system"));
}

TEST(OpenCapCalibration, RecognisesItsFiles) {
  const auto format = make_opencap_calibration();
  EXPECT_TRUE(format->recognises(source_of(OpenCapFile(opencap_dict()).path())));
  EXPECT_TRUE(format->recognises({"any", "(dp0\nS'intrinsicMat'\n", false}));
  EXPECT_FALSE(format->recognises({"any", "{\"intrinsicMat\": []}", false}));
  EXPECT_FALSE(format->recognises({"any", pickled(py_dict({{"K", "N"}})), false}));
  EXPECT_FALSE(format->recognises({"any", "", false}));
  EXPECT_FALSE(format->recognises({"any", "", true}));
}

TEST(OpenCapCalibration, SurvivesHostileFiles) {
  const TemporaryFolder folder;
  support::expect_survives_hostile_files(folder / "c.pickle", opencap_dict(opencap_pose()), read_opencap);
}

// ZJU-MoCap: an array of one object, the dict.

class ZjuFile {
 public:
  explicit ZjuFile(const std::string& dict) { write_bytes(path(), npy_of_objects(dict)); }
  std::filesystem::path path() const { return folder_ / "annots.npy"; }
  Calibration read() const { return read_zju(path()); }
  std::string refusal() const {
    return message_of<FileError>([&] { read(); });
  }

 private:
  TemporaryFolder folder_;
};

TEST(ZjuCalibration, ReadsTheCameras) {
  const Calibration calibration = ZjuFile(two_zju_cameras()).read();
  EXPECT_EQ(calibration.unit, "mm");
  EXPECT_EQ(calibration.up, "+z");
  EXPECT_THAT(names_of(calibration), ElementsAre("Camera_B4", "Camera_B7"));
  EXPECT_THAT(calibration.notes, IsEmpty());
  const Camera& camera = calibration.cameras[1];
  EXPECT_EQ(camera.width + camera.height, 0);
  EXPECT_EQ(camera.K(0, 2), 512.5);
  EXPECT_LT((camera.centre() - Eigen::Vector3d(-0.1, -3, 0.2)).norm(), kTolerance);
  const double x = 0.3 / 3.6, y = 0.3 / 3.6, r2 = x * x + y * y;
  const double radial = 1 + 0.1 * r2 - 0.2 * r2 * r2 + 0.05 * r2 * r2 * r2;
  const double u = 1500 * (x * radial + 2 * 0.001 * x * y + 0.002 * (r2 + 2 * x * x)) + 512.5;
  EXPECT_NEAR(camera.project({0.2, 0.6, -0.1}).x(), u, kTolerance);
}

TEST(ZjuCalibration, ReadsOneArrayForAllCameras) {
  const std::string R = py_matrix({2, 3, 3}, {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, -1, 0, 1, 0});
  const std::string T = py_matrix({2, 3, 1}, {1000, 0, 0, 100, 200, 3000});
  const std::string dict = zju_dict(py_list({kZjuK, kZjuK}), py_matrix({2, 5}, std::vector<double>(10, 0)), R, T, {});
  const Calibration calibration = ZjuFile(dict).read();
  ASSERT_THAT(calibration.cameras, SizeIs(2));
  EXPECT_LT((calibration.cameras[0].centre() - Eigen::Vector3d(-1, 0, 0)).norm(), kTolerance);
  EXPECT_LT((calibration.cameras[1].centre() - Eigen::Vector3d(-0.1, -3, 0.2)).norm(), kTolerance);
}

TEST(ZjuCalibration, NamesTheCamerasByTheFoldersOfTheirImages) {
  const auto names = [](const std::vector<std::string>& paths) {
    return names_of(ZjuFile(two_zju_cameras(paths)).read());
  };
  EXPECT_THAT(names({"images/04/1.jpg", "images/05/1.jpg"}), ElementsAre("04", "05"));
  EXPECT_THAT(names({"04/images/1.jpg", "05/images/1.jpg"}), ElementsAre("04/images", "05/images"));
  EXPECT_THAT(names({"1.jpg", "2.jpg"}), ElementsAre("0", "1"));
  EXPECT_THAT(names({"same/1.jpg", "same/2.jpg"}), ElementsAre("0", "1"));
  EXPECT_THAT(names({"04/1.jpg"}), ElementsAre("0", "1"));
  EXPECT_THAT(ZjuFile(two_zju_cameras({})).read().notes, SizeIs(1));
}

TEST(ZjuCalibration, NamesTheFaults) {
  const std::string K = py_list({kZjuK}), D = py_list({kZjuD}), R = py_list({zju_rotation()}), T = py_list({kZjuT});
  EXPECT_THAT(ZjuFile(zju_dict(K, D, R, py_list({kZjuT, kZjuT}), {})).refusal(),
              AllOf(HasSubstr("annots.npy"), HasSubstr("1 R and 2 T")));
  EXPECT_THAT(ZjuFile(zju_dict(K, D, py_list({kZjuT}), T, {})).refusal(),
              HasSubstr("cams.R of camera 0 has 3 numbers, expected 9"));
  EXPECT_THAT(ZjuFile(zju_dict(K, D, py_list({py_text("x")}), T, {})).refusal(), HasSubstr("cams.R of camera 0"));
  EXPECT_THAT(ZjuFile(py_dict({{"ims", "]"}})).refusal(), HasSubstr("\"cams\""));
  EXPECT_THAT(ZjuFile(py_dict({{"cams", py_dict({{"K", K}})}})).refusal(), HasSubstr("\"D\""));
  EXPECT_THAT(ZjuFile("K\1").refusal(), HasSubstr("must be a dict"));
  const TemporaryFolder folder;
  write_bytes(folder / "a.npy", npy_of_objects(two_zju_cameras(), "<f8"));
  EXPECT_THAT(message_of<FileError>([&] { read_zju(folder / "a.npy"); }), HasSubstr("no .npy file of Python objects"));
}

TEST(ZjuCalibration, RecognisesItsFiles) {
  const auto format = make_zju_calibration();
  EXPECT_TRUE(format->recognises(source_of(ZjuFile(two_zju_cameras()).path())));
  EXPECT_FALSE(format->recognises({"annots.npy", npy_of_objects(two_zju_cameras(), "<f8"), false}));
  EXPECT_FALSE(format->recognises({"annots.npy", npy_of_objects(py_dict({{"other", "N"}})), false}));
  EXPECT_FALSE(format->recognises({"annots.npy", "\x93NUMPY", false}));
  EXPECT_FALSE(format->recognises({"annots.npy", "", true}));
}

TEST(ZjuCalibration, SurvivesHostileFiles) {
  const TemporaryFolder folder;
  support::expect_survives_hostile_files(folder / "annots.npy", npy_of_objects(two_zju_cameras()), read_zju);
}

}  // namespace
}  // namespace doppel::binary_calibrations_test
