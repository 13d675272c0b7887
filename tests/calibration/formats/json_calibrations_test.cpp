#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "calibration/formats/source_of.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::json_calibrations_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using support::names_of;
using support::source_of;
using support::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Json = nlohmann::json;
using Maker = std::unique_ptr<CalibrationFormat> (*)();

/// Files of one format in a folder of their own.
class Files {
 public:
  explicit Files(Maker make) : format_(make()) {}

  Calibration read_text(const std::string& text) {
    support::write_bytes(path(), text);
    return format_->read(source_of(path()));
  }
  Calibration read(const Json& json) { return read_text(json.dump(1)); }
  Camera first(const Json& json) { return read(json).cameras.at(0); }
  std::string refusal(const Json& json) {
    return message_of<Error>([&] { read(json); });
  }
  void expect_survives(const std::string& text) {
    support::expect_survives_hostile_files(path(), text, [&](const auto& file) { format_->read(source_of(file)); });
  }
  /// The name is that of a subject, for formats whose files hold several.
  std::filesystem::path path() const { return folder_ / "S9.any"; }
  const CalibrationFormat& format() const { return *format_; }

 private:
  TemporaryFolder folder_;
  std::unique_ptr<CalibrationFormat> format_;
};

/// The pixel of a point (right, down, forward) of a camera by OpenCV's model with five coefficients.
Eigen::Vector2d pixel_of(const Eigen::Vector3d& p, const Eigen::Vector4d& K, const std::array<double, 5>& k) {
  const double x = p.x() / p.z(), y = p.y() / p.z(), r2 = x * x + y * y;
  const double radial = 1 + k[0] * r2 + k[1] * r2 * r2 + k[4] * r2 * r2 * r2;
  const double u = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
  const double v = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
  return {K[0] * u + K[2], K[1] * v + K[3]};
}

void expect_pixel(const Camera& camera, const Eigen::Vector3d& point, const Eigen::Vector2d& pixel) {
  EXPECT_NEAR((camera.project(point) - pixel).norm(), 0.0, 1e-9)
      << camera.project(point).transpose() << " is not " << pixel.transpose();
}

// ---- transforms.json ----

/// A camera at (0, -4, 1) of a world with z up that looks along +y.
Json frame(const std::string& file) {
  return {{"file_path", file}, {"transform_matrix", {{1, 0, 0, 0}, {0, 0, -1, -4}, {0, 1, 0, 1}, {0, 0, 0, 1}}}};
}

Json transforms() {
  return {{"w", 640},
          {"h", 480.0},
          {"fl_x", 500.0},
          {"fl_y", 510.0},
          {"cx", 321.0},
          {"cy", 242.0},
          {"frames", {frame("./images/left.png")}}};
}

/// The point that the camera of `frame` sees at (0.5, -0.2, 4): right, down, forward.
const Eigen::Vector3d kSeen(0.5, 0.0, 1.2);

TEST(TransformsCalibrationReference, AxesAndOrderOfTheDistortion) {
  Files files(make_transforms_calibration);
  Json file = transforms();
  file["frames"][0].update({{"k1", 0.1}, {"k2", -0.05}, {"k3", 0.03}, {"p1", 0.01}, {"p2", 0.02}, {"fl_x", 505.0}});
  const Calibration found = files.read(file);
  EXPECT_EQ(found.unit, "");
  EXPECT_EQ(found.up, "+z");
  EXPECT_FALSE(found.has_scale);
  const Camera& camera = found.cameras.at(0);
  EXPECT_EQ(camera.name, "left");
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.height, 480);
  EXPECT_LT((camera.centre() - Eigen::Vector3d(0, -4, 1)).norm(), 1e-12);
  // The value of the frame is taken before that of the file, and the first pixel's centre is (0.5, 0.5) already.
  expect_pixel(camera, kSeen, pixel_of({0.5, -0.2, 4}, {505, 510, 321, 242}, {0.1, -0.05, 0.01, 0.02, 0.03}));
}

TEST(TransformsCalibrationReference, LensesOfNerfstudio) {
  Files files(make_transforms_calibration);
  Json file = transforms();
  file.update({{"k1", 0.1}, {"k2", 0.02}, {"k3", 0.003}, {"k4", 0.0004}, {"camera_model", "OPENCV_FISHEYE"}});
  const double r = std::hypot(0.125, 0.05), a = std::atan(r), b = a * a;
  const double turned = a * (1 + b * (0.1 + b * (0.02 + b * (0.003 + b * 0.0004)))) / r;
  expect_pixel(files.first(file), kSeen, {321 + 500 * 0.125 * turned, 242 - 510 * 0.05 * turned});
  file.erase("camera_model");
  file["is_fisheye"] = true;
  EXPECT_EQ(files.first(file).lens, Lens::fisheye);
  file["is_fisheye"] = false;
  const double q = r * r, grown = 1 + q * (0.1 + q * (0.02 + q * (0.003 + q * 0.0004)));
  expect_pixel(files.first(file), kSeen, {321 + 500 * 0.125 * grown, 242 - 510 * 0.05 * grown});
}

TEST(TransformsCalibrationReference, AnAngleNeedsTheSizeOfTheImage) {
  Files files(make_transforms_calibration);
  Json file = {{"camera_angle_x", 0.8}, {"frames", {frame("./shot")}}};
  EXPECT_THAT(files.refusal(file), AllOf(HasSubstr("(./shot)"), HasSubstr("fl_x"), HasSubstr("\"w\"")));
  cv::imwrite((files.path().parent_path() / "shot.png").string(), cv::Mat(40, 60, CV_8UC1, cv::Scalar(0)));
  const Camera camera = files.first(file);
  EXPECT_EQ(camera.width, 60);
  EXPECT_EQ(camera.height, 40);
  const double f = 30 / std::tan(0.4);
  expect_pixel(camera, kSeen, {30 + f * 0.125, 20 - f * 0.05});
  support::write_bytes(files.path().parent_path() / "shot.png", "this is no image");
  EXPECT_THAT(files.refusal(file), HasSubstr("is no image"));
}

TEST(TransformsCalibrationReference, IntrinsicsAsAMatrixAndASizeThatIsMissing) {
  Files files(make_transforms_calibration);
  Json file = {{"frames", {frame("a.png")}}};
  file["frames"][0]["K"] = {{500, 0, 321}, {0, 510, 242}, {0, 0, 1}};
  const Camera camera = files.first(file);
  EXPECT_EQ(camera.width, 0);
  expect_pixel(camera, kSeen, {321 + 500 * 0.125, 242 - 510 * 0.05});
}

TEST(TransformsCalibrationReference, AppliedTransformIsUndone) {
  Files files(make_transforms_calibration);
  Json file = transforms();
  // x, y, z of the reconstruction became 2 (z + 5), 2 x, 2 y, and then everything three times as large.
  file["applied_transform"] = {{0, 0, 2, 10}, {2, 0, 0, 0}, {0, 2, 0, 0}};
  file["applied_scale"] = 3;
  const Calibration found = files.read(file);
  EXPECT_EQ(found.up, "");
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("applied_transform")));
  // (0, -4, 1) / 3 = (2 (z + 5), 2 x, 2 y), and the camera looks along the file's y, which is x.
  EXPECT_LT((found.cameras[0].centre() - Eigen::Vector3d(-2.0 / 3, 1.0 / 6, -5)).norm(), 1e-12);
  EXPECT_LT((found.cameras[0].R.row(2) - Eigen::RowVector3d(1, 0, 0)).norm(), 1e-12);
  EXPECT_NEAR(found.cameras[0].R.determinant(), 1.0, 1e-12);
  file["applied_transform"] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, -1, 0}};
  EXPECT_THAT(files.refusal(file), HasSubstr("applied_transform must be a rotation"));
}

/// Matrices of four cameras on a circle, upright in a world with z up. @param inward whether they look at the middle
/// @param forward writes z forward and y down
Json circle(bool inward, bool forward) {
  Json file = transforms();
  file["frames"].clear();
  for (int i = 0; i < 4; ++i) {
    const double angle = 1.5 * i;
    const Eigen::Vector3d out(std::cos(angle), std::sin(angle), 0.0), up = Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d look = inward ? Eigen::Vector3d(-out) : out, right = look.cross(up);
    const Eigen::Vector3d second = forward ? Eigen::Vector3d(-up) : up, third = forward ? look : Eigen::Vector3d(-look);
    Json item = frame(std::to_string(i) + ".png");
    for (int row = 0; row < 3; ++row)
      item["transform_matrix"][static_cast<std::size_t>(row)] = {right[row], second[row], third[row], 3 * out[row]};
    file["frames"].push_back(item);
  }
  return file;
}

TEST(TransformsCalibrationReference, MatricesWithZForwardAreRecognised) {
  Files files(make_transforms_calibration);
  const Calibration expected = files.read(circle(true, false)), found = files.read(circle(true, true));
  EXPECT_THAT(expected.notes, ElementsAre());
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("z forward")));
  EXPECT_EQ(found.up, "");
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT((found.cameras[i].R - expected.cameras[i].R).norm(), 1e-12);
    EXPECT_LT((found.cameras[i].t - expected.cameras[i].t).norm(), 1e-12);
  }
  // Cameras that look outward and are upright are what the format says.
  EXPECT_THAT(files.read(circle(false, false)).notes, ElementsAre());
}

TEST(TransformsCalibrationReference, NamesAreFilesOrFoldersOrPaths) {
  Files files(make_transforms_calibration);
  const auto names = [&](const std::vector<std::string>& paths) {
    Json file = transforms();
    file["frames"].clear();
    for (const std::string& path : paths) {
      file["frames"].push_back(frame(path));
      file["frames"].back()["cx"] = 300 + file["frames"].size();
    }
    return names_of(files.read(file));
  };
  EXPECT_THAT(names({"./images/a.png", "images/S1.5413"}), ElementsAre("a", "S1.5413"));
  EXPECT_THAT(names({"left/0000.png", "right\\0000.png"}), ElementsAre("left", "right"));
  EXPECT_THAT(names({"x/left/0000.png", "y/left/0000.png"}), ElementsAre("x_left_0000", "y_left_0000"));
  EXPECT_THAT(names({"a.png", "a.png"}), ElementsAre("a_0", "a_1"));
}

TEST(TransformsCalibrationReference, VideosOfStillCamerasGiveOneCameraEach) {
  Files files(make_transforms_calibration);
  Json file = transforms();
  file["frames"] = {frame("left/0.png"),
                    frame("right/0.png"),
                    frame("left/1.png"),
                    frame("right/1.png"),
                    {{"file_path", "lost.png"}}};
  const Calibration found = files.read(file);
  EXPECT_THAT(names_of(found), ElementsAre("left", "right"));
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("2 frames that repeat"), HasSubstr("1 frames without")));
}

TEST(TransformsCalibrationRejects, WhatFilesGetWrong) {
  Files files(make_transforms_calibration);
  const auto refusal = [&](const Json& change) {
    Json file = transforms();
    file["frames"][0].update(change);
    return files.refusal(file);
  };
  EXPECT_THAT(refusal({{"camera_model", "FULL_OPENCV"}}), HasSubstr("camera_model is \"FULL_OPENCV\", allowed are"));
  EXPECT_THAT(refusal({{"is_fisheye", true}, {"p1", 0.1}}), HasSubstr("must not have p1"));
  EXPECT_THAT(refusal({{"w", 640.5}}), HasSubstr("w is 640.5, allowed are integers"));
  EXPECT_THAT(refusal({{"cx", "middle"}}), HasSubstr("cx must be a finite number"));
  EXPECT_THAT(refusal({{"file_path", 7}}), HasSubstr("frame 0: file_path must be a text"));
  EXPECT_THAT(refusal({{"transform_matrix", {1, 2, 3}}}), HasSubstr("has 3 numbers, expected 12 or 16"));
  EXPECT_THAT(refusal({{"transform_matrix", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 2}}}}),
              HasSubstr("the last row"));
  EXPECT_THAT(refusal({{"ftheta_p0", 0.1}}), HasSubstr("ftheta_p0"));
  EXPECT_THAT(files.refusal({{"frames", {{{"file_path", "a.png"}}}}}), HasSubstr("no item of \"frames\""));
  EXPECT_THAT(files.refusal({{"frames", {frame("a.png")}}}), HasSubstr("fl_x is missing"));
  EXPECT_THAT(files.refusal({{"frames", 7}}), HasSubstr("\"frames\" must be a list"));
}

/// Cameras of the program's world (y up) with the lenses that the format holds.
std::vector<Camera> cameras_to_write() {
  std::vector<Camera> cameras;
  for (int i = 0; i < 3; ++i) {
    Camera camera;
    camera.name = "cam." + std::to_string(i);
    camera.width = 640 + i;
    camera.height = 480;
    camera.K << 500.123456789, 0, 320.1 + i, 0, 510 / 7.0, 241.7, 0, 0, 1;
    camera.R = Eigen::AngleAxisd(0.3 + i, Eigen::Vector3d(1, 2, -0.5).normalized()).toRotationMatrix();
    camera.t = Eigen::Vector3d(0.1, -1.0 / 3, 4.0 + i);
    camera.distortion = {0.1 / 3, -0.02, 0.001, 0.002};
    if (i == 1) camera.lens = Lens::fisheye;
    if (i == 2) camera.distortion[4] = 0.07;
    cameras.push_back(camera);
  }
  // Two cameras at one position that look away from each other, which the reader must take as they are.
  cameras.push_back(cameras[0]);
  cameras.back().name = "double";
  return cameras;
}

TEST(TransformsCalibrationReference, WhatIsWrittenIsReadBackAfterTheTurnOfTheWorld) {
  Files files(make_transforms_calibration);
  const std::vector<Camera> cameras = cameras_to_write();
  ASSERT_TRUE(files.format().can_write());
  files.format().write(files.path(), cameras);
  EXPECT_TRUE(files.format().recognises(source_of(files.path())));
  const Calibration found = files.format().read(source_of(files.path()));
  EXPECT_EQ(found.up, "+z");
  EXPECT_THAT(found.notes, ElementsAre());
  ASSERT_EQ(found.cameras.size(), cameras.size());
  Eigen::Matrix3d turn;  // what the caller does: (x, y, z) becomes (x, z, -y)
  turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& read = found.cameras[i];
    EXPECT_EQ(read.name, cameras[i].name);
    EXPECT_EQ(read.width, cameras[i].width);
    EXPECT_EQ(read.K, cameras[i].K);
    EXPECT_EQ(read.lens, cameras[i].lens);
    EXPECT_EQ(read.distortion, cameras[i].distortion);
    EXPECT_LT((read.R * turn.transpose() - cameras[i].R).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_LT((read.t - cameras[i].t).cwiseAbs().maxCoeff(), 1e-14 * cameras[i].t.norm() + 1e-14);
  }
}

TEST(TransformsCalibrationReference, TheWrittenWorldHasZUp) {
  Files files(make_transforms_calibration);
  Camera camera = cameras_to_write()[0];
  camera.R = Eigen::Vector3d(1, -1, -1).asDiagonal();  // looks along -z of our world, upright
  camera.t = -camera.R * Eigen::Vector3d(1, 2, 3);
  files.format().write(files.path(), {camera});
  std::ifstream stream(files.path());
  const Json matrix = Json::parse(stream)["frames"][0]["transform_matrix"];
  // Our y is the file's z, our -z its y: at (1, -3, 2), up is z, and back, against the view, is -y.
  EXPECT_EQ(matrix, Json({{1, 0, 0, 1}, {0, 0, -1, -3}, {0, 1, 0, 2}, {0, 0, 0, 1}}));
}

TEST(TransformsCalibrationRejects, CamerasThatTheFormatCannotHold) {
  Files files(make_transforms_calibration);
  const auto refusal = [&](const std::function<void(Camera&)>& change) {
    Camera camera = cameras_to_write()[0];
    change(camera);
    return message_of<Error>([&] { files.format().write(files.path(), {camera}); });
  };
  EXPECT_THAT(refusal([](Camera& c) { c.K(0, 1) = 1; }), HasSubstr("camera cam.0 has skew 1"));
  EXPECT_THAT(refusal([](Camera& c) { c.lens = Lens::polynomial; }), HasSubstr("lens of camera cam.0"));
  EXPECT_THAT(refusal([](Camera& c) { c.distortion[5] = 1; }), HasSubstr("lens of camera cam.0"));
  EXPECT_THAT(refusal([](Camera& c) { c.width = 0; }), HasSubstr("image size is 0x480"));
  EXPECT_FALSE(std::filesystem::exists(files.path()));
}

// ---- cameras.json of Gaussian splatting ----

/// A camera at (1, 2, 3) that looks along +x with y down: right is -z.
Json splatting() {
  return Json::array({{{"id", 0},
                       {"img_name", "a"},
                       {"width", 800},
                       {"height", 601},
                       {"position", {1, 2, 3}},
                       {"rotation", {{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}}},
                       {"fy", 710.0},
                       {"fx", 700.0}}});
}

TEST(SplattingCalibrationReference, RotationIsWorldFromCameraAndTheCentreIsThatOfTheImage) {
  Files files(make_gaussian_splatting_calibration);
  const Calibration found = files.read(splatting());
  EXPECT_EQ(found.unit, "");
  EXPECT_EQ(found.up, "");
  EXPECT_FALSE(found.has_scale);
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("no principal points")));
  EXPECT_LT((found.cameras[0].centre() - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  // 4 forward (+x), 0.2 down (+y), 0.5 right (-z)
  expect_pixel(found.cameras[0], {5, 2.2, 2.5}, {400 + 700 * 0.125, 300.5 + 710 * 0.05});
}

TEST(SplattingCalibrationReference, ImagesOfOneNameBecomeDifferentCameras) {
  Files files(make_gaussian_splatting_calibration);
  Json file = splatting();
  file.push_back(file[0]);
  EXPECT_THAT(names_of(files.read(file)), ElementsAre("a", "a_1"));
}

TEST(SplattingCalibrationRejects, WhatIsMissingOrWrong) {
  Files files(make_gaussian_splatting_calibration);
  for (const char* key : {"width", "height", "position", "rotation", "fx", "fy"}) {
    Json file = splatting();
    file[0].erase(key);
    EXPECT_THAT(files.refusal(file), HasSubstr(fmt::format("camera a: {}", key)));
  }
  Json file = splatting();
  file[0]["width"] = 1e200;
  EXPECT_THAT(files.refusal(file), HasSubstr("camera a: width is 1e+200"));
  EXPECT_THAT(files.refusal(Json::array()), HasSubstr("must be a list of cameras"));
}

// ---- CMU Panoptic ----

/// A camera 400 cm in front of the origin on the side of -z, in a world with y down.
Json panoptic_camera(const std::string& name, const std::string& type) {
  return {{"name", name},
          {"type", type},
          {"resolution", {1920, 1080}},
          {"K", {{1500, 0, 950}, {0, 1510, 530}, {0, 0, 1}}},
          {"distCoef", {-0.2, 0.1, 0.01, 0.02, 0.03}},
          {"R", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
          {"t", {{0}, {100}, {400}}}};
}
Json panoptic() {
  return {
      {"calibDataSource", "made"},
      {"cameras", {panoptic_camera("00_01", "hd"), panoptic_camera("03_07", "vga"), panoptic_camera("00_02", "hd")}}};
}

TEST(PanopticCalibrationReference, CentimetresYDownAndPixelCentresAtIntegers) {
  Files files(make_panoptic_calibration);
  const Calibration found = files.read(panoptic());
  EXPECT_EQ(found.unit, "cm");
  EXPECT_EQ(found.up, "-y");
  EXPECT_THAT(names_of(found), ElementsAre("00_01", "03_07", "00_02"));
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("2 hd, 1 vga")));
  const Camera& camera = found.cameras[0];
  EXPECT_EQ(camera.width, 1920);
  EXPECT_EQ(camera.height, 1080);
  EXPECT_LT((camera.centre() - Eigen::Vector3d(0, -1, -4)).norm(), 1e-12);
  expect_pixel(camera, {0.5, -1.2, 0},
               pixel_of({0.5, -0.2, 4}, {1500, 1510, 950.5, 530.5}, {-0.2, 0.1, 0.01, 0.02, 0.03}));
}

TEST(PanopticCalibrationRejects, WhatIsMissingOrWrong) {
  Files files(make_panoptic_calibration);
  for (const char* key : {"type", "resolution", "K", "distCoef", "R", "t"}) {
    Json file = panoptic();
    file["cameras"][1].erase(key);
    EXPECT_THAT(files.refusal(file), HasSubstr(fmt::format("camera 03_07: {}", key)));
  }
  Json file = panoptic();
  file["cameras"][0]["resolution"] = {1920, 1e200};
  EXPECT_THAT(files.refusal(file), HasSubstr("camera 00_01: resolution is 1e+200"));
  EXPECT_THAT(files.refusal({{"cameras", Json::array()}}), HasSubstr("\"cameras\" must be a list"));
}

// ---- Shelf, Campus ----

/// A camera at (-3000, 100, 1500) mm that looks along +x, with z up: right is -y, down is -z.
Json shelf_camera() {
  return {{"fx", 1000},
          {"fy", 1010.5},
          {"cx", 510},
          {"cy", 380},
          {"k", {{-0.2}, {0.1}, {0.03}}},
          {"p", {{0.01}, {0.02}}},
          {"R", {{0, -1, 0}, {0, 0, -1}, {1, 0, 0}}},
          {"T", {{-3000}, {100}, {1500}}}};
}
Json shelf() { return {{"0", shelf_camera()}, {"2", shelf_camera()}, {"10", shelf_camera()}}; }

TEST(ShelfCalibrationReference, TIsTheCentreInMillimetres) {
  Files files(make_shelf_calibration);
  const Calibration found = files.read(shelf());
  EXPECT_EQ(found.unit, "mm");
  EXPECT_EQ(found.up, "+z");
  EXPECT_THAT(names_of(found), ElementsAre("0", "2", "10"));
  EXPECT_EQ(found.cameras[0].width, 0);
  EXPECT_LT((found.cameras[0].centre() - Eigen::Vector3d(-3, 0.1, 1.5)).norm(), 1e-12);
  // 4 forward (+x), 0.5 right (-y), 0.2 up (+z)
  expect_pixel(found.cameras[0], {1, -0.4, 1.7},
               pixel_of({0.5, -0.2, 4}, {1000, 1010.5, 510.5, 380.5}, {-0.2, 0.1, 0.01, 0.02, 0.03}));
}

TEST(ShelfCalibrationRejects, WhatIsMissing) {
  Files files(make_shelf_calibration);
  for (const char* key : {"fx", "fy", "cx", "cy", "k", "p", "R", "T"}) {
    Json file = shelf();
    file["2"].erase(key);
    EXPECT_THAT(files.refusal(file), HasSubstr(fmt::format("camera 2: {}", key)));
  }
  EXPECT_THAT(files.refusal({{"0", 7}}), HasSubstr("camera 0: must be an object"));
}

// ---- AIST++ ----

/// A camera 400 cm in front of the origin on the side of +z, turned by pi about x, in a world with y up.
Json aist() {
  return Json::array({{{"name", "c01"},
                       {"size", {1920, 1080}},
                       {"matrix", {{1500, 0, 950}, {0, 1510, 530}, {0, 0, 1}}},
                       {"distortions", {-0.2, 0.1, 0.01, 0.02, 0.03}},
                       {"rotation", {M_PI, 0, 0}},
                       {"translation", {0, 100, 400}}}});
}

TEST(AistCalibrationReference, CentimetresYUpAndPixelCentresAtIntegers) {
  Files files(make_aist_calibration);
  const Calibration found = files.read(aist());
  EXPECT_EQ(found.unit, "cm");
  EXPECT_EQ(found.up, "+y");
  EXPECT_EQ(found.cameras[0].name, "c01");
  EXPECT_EQ(found.cameras[0].height, 1080);
  EXPECT_LT((found.cameras[0].centre() - Eigen::Vector3d(0, 1, 4)).norm(), 1e-12);
  expect_pixel(found.cameras[0], {0.5, 1.2, 0},
               pixel_of({0.5, -0.2, 4}, {1500, 1510, 950.5, 530.5}, {-0.2, 0.1, 0.01, 0.02, 0.03}));
}

TEST(AistCalibrationReference, FisheyeOfAniposelib) {
  Files files(make_aist_calibration);
  Json file = aist();
  file[0]["fisheye"] = true;
  file[0]["distortions"] = {0.1, 0.02, 0.003, 0.0004};
  EXPECT_EQ(files.first(file).lens, Lens::fisheye);
  EXPECT_EQ(files.first(file).distortion[3], 0.0004);
}

TEST(AistCalibrationRejects, WhatIsMissingOrWrong) {
  Files files(make_aist_calibration);
  for (const char* key : {"size", "matrix", "distortions", "rotation", "translation"}) {
    Json file = aist();
    file[0].erase(key);
    EXPECT_THAT(files.refusal(file), HasSubstr(fmt::format("camera c01: {}", key)));
  }
  Json file = aist();
  file[0]["size"] = {0, 1080};
  EXPECT_THAT(files.refusal(file), HasSubstr("camera c01: size is 0"));
  file[0].erase("name");
  EXPECT_THAT(files.refusal(file), HasSubstr("\"name\""));
}

// ---- Human3.6M ----

/// A camera at (-3000, 100, 1500) mm that looks along +x, with z up: right is -y, down is -z.
Json human_pose(bool centre) {
  Json pose = {{"R", {{0, -1, 0}, {0, 0, -1}, {1, 0, 0}}}};
  pose[centre ? "T" : "t"] = centre ? Json({-3000, 100, 1500}) : Json({{100}, {1500}, {3000}});
  return pose;
}
Json human_lens() { return {{"f", {1140, 1150}}, {"c", {512, 515}}, {"k", {-0.2, 0.1, 0.03}}, {"p", {0.01, 0.02}}}; }
Json human_camera(bool centre) {
  Json camera = human_lens();
  camera.update(human_pose(centre));
  return camera;
}
/// The same camera as VideoPose3D describes it.
Json human_video_pose(const std::string& id) {
  return {{"id", id},
          {"center", {512, 515}},
          {"focal_length", {1140, 1150}},
          {"radial_distortion", {-0.2, 0.1, 0.03}},
          {"tangential_distortion", {0.02, 0.01}},
          {"res_w", 1000},
          {"res_h", 1002},
          {"orientation", {0.5, -0.5, 0.5, -0.5}},
          {"translation", {-3000, 100, 1500}}};
}
/// And as camera-parameters.json does, for two subjects.
Json human_parameters() {
  const Json lens = {{"calibration_matrix", {{1140, 0, 512}, {0, 1150, 515}, {0, 0, 1}}},
                     {"distortion", {-0.2, 0.1, 0.01, 0.02, 0.03}}};
  Json other = human_pose(false);
  other["t"] = {1, 2, 3};
  return {{"intrinsics", {{"54138969", lens}, {"55011271", lens}}},
          {"extrinsics",
           {{"S11", {{"54138969", other}, {"55011271", other}}},
            {"S9", {{"54138969", human_pose(false)}, {"55011271", human_pose(false)}}}}}};
}

void expect_human_camera(const Camera& camera) {
  SCOPED_TRACE(camera.name);
  EXPECT_LT((camera.centre() - Eigen::Vector3d(-3, 0.1, 1.5)).norm(), 1e-12);
  // 4 forward (+x), 0.5 right (-y), 0.2 up (+z)
  expect_pixel(camera, {1, -0.4, 1.7},
               pixel_of({0.5, -0.2, 4}, {1140, 1150, 512.5, 515.5}, {-0.2, 0.1, 0.01, 0.02, 0.03}));
}

TEST(Human36mCalibrationReference, TheKeysDecideBetweenTranslationAndCentre) {
  Files files(make_human36m_calibration);
  const Calibration found = files.read(Json{{"54138969", human_camera(false)}, {"58860488", human_camera(true)}});
  EXPECT_EQ(found.unit, "mm");
  EXPECT_EQ(found.up, "+z");
  EXPECT_THAT(names_of(found), ElementsAre("54138969", "58860488"));
  for (const Camera& camera : found.cameras) expect_human_camera(camera);
  EXPECT_EQ(found.cameras[0].height, 1002);
  EXPECT_EQ(found.cameras[1].height, 1000);
  EXPECT_EQ(files.first({{"1", human_camera(false)}}).width, 0) << "the size of another camera is not known";
}

/// The rigs of two subjects: those of S9, and those of S11 moved by a metre.
Json human_two_subjects() {
  Json file = human_parameters();
  file["extrinsics"]["S11"] = file["extrinsics"]["S9"];
  for (auto& [name, camera] : file["extrinsics"]["S11"].items()) camera["t"] = {0, 0, 7000};
  return file;
}

TEST(Human36mCalibrationReference, TheNearestFolderOrTheFileNamesTheSubject) {
  const TemporaryFolder folder;
  const auto format = make_human36m_calibration();
  const auto depth = [&](const fs::path& file, const std::string& subject = "") {
    fs::create_directories((folder / file).parent_path());
    std::ofstream(folder / file) << human_two_subjects().dump();
    const Calibration found = format->read({folder / file, "", false, subject});
    EXPECT_THAT(found.notes, ElementsAre(HasSubstr("2 subjects")));
    return found.cameras.at(0).t.z();
  };
  const double s9 = depth("any/c.json", "S9"), s11 = depth("any/c.json", "s11");
  EXPECT_EQ(s11, 7.0);
  EXPECT_NE(s9, s11);
  for (const char* file : {"S9/camera-parameters.json", "s9/c.json", "S9/calibration/c.json", "h36m_S9/c.json",
                           "S11/S9/c.json", "S11/cameras_S9.json", "S9/S1_S9_S11.json"})
    EXPECT_EQ(depth(file), s9) << file;
  for (const char* file : {"S11/c.json", "S9/S11/c.json", "S11-Walking/c.json"}) EXPECT_EQ(depth(file), s11) << file;
  EXPECT_EQ(depth("S9/d.json", "S11"), s11) << "what the user says counts";
}

TEST(Human36mCalibrationRejects, AFileOfSeveralSubjectsThatNothingDecides) {
  const TemporaryFolder folder;
  const auto format = make_human36m_calibration();
  const auto refusal = [&](const fs::path& file, const std::string& subject = "") {
    fs::create_directories((folder / file).parent_path());
    std::ofstream(folder / file) << human_two_subjects().dump();
    return message_of<Error>([&] { format->read({folder / file, "", false, subject}); });
  };
  for (const char* file : {"any/c.json", "S1/c.json", "S9-S11/c.json", "S90/c.json", "S9/a/b/c.json"})
    EXPECT_THAT(refusal(file), AllOf(HasSubstr("2 subjects (S11, S9)"), HasSubstr("--subject"))) << file;
  EXPECT_THAT(refusal("S9/c.json", "S1"), AllOf(HasSubstr("subject \"S1\""), HasSubstr("S11, S9")));
  std::ofstream(folder / "one.json") << Json{{"54138969", human_camera(false)}}.dump();
  EXPECT_THAT(message_of<UsageError>([&] {
                format->read({folder / "one.json", "", false, "S1"});
              }),
              HasSubstr("does not tell subjects apart"));
}

TEST(Human36mCalibrationReference, TheOnlySubjectWithPosesOfCameraParameters) {
  Files files(make_human36m_calibration);
  Json file = human_parameters();
  file["extrinsics"]["S11"] = {{"54138969", Json::object()}, {"55011271", Json::object()}};
  Calibration found = files.read(file);
  EXPECT_THAT(names_of(found), ElementsAre("54138969", "55011271"));
  for (const Camera& camera : found.cameras) expect_human_camera(camera);
  EXPECT_THAT(found.notes, ElementsAre(AllOf(HasSubstr("2 subjects"), HasSubstr("those of S9"))));
  file["extrinsics"]["S9"].erase("54138969");
  found = files.read(file);
  EXPECT_THAT(names_of(found), ElementsAre("55011271"));
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("S9"), HasSubstr("1 cameras were left out")));
}

TEST(Human36mCalibrationReference, ListsOfVideoPose3d) {
  Files files(make_human36m_calibration);
  const Json camera = human_video_pose("54138969");
  expect_human_camera(files.first(Json::array({camera})));
  EXPECT_EQ(files.first(Json::array({camera})).name, "54138969");
  EXPECT_EQ(files.first(Json::array({camera})).height, 1002);
  // Subjects without published poses have empty entries.
  const Calibration found = files.read(Json{{"S1", {Json::object(), Json::object()}}, {"S5", {camera}}});
  expect_human_camera(found.cameras[0]);
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("those of S5")));
  // Intrinsics and poses in two lists, which pair by position.
  Json pose = {{"orientation", camera["orientation"]}, {"translation", camera["translation"]}};
  Json file = {{"intrinsics", {human_video_pose("a"), human_video_pose("b")}}, {"extrinsics", {{"S1", {pose, pose}}}}};
  EXPECT_THAT(names_of(files.read(file)), ElementsAre("a", "b"));
}

TEST(Human36mCalibrationRejects, WhatIsMissing) {
  Files files(make_human36m_calibration);
  for (const char* key : {"f", "c", "k", "p", "t"}) {
    Json file = {{"7", human_camera(false)}};
    file["7"].erase(key);
    EXPECT_THAT(files.refusal(file), HasSubstr(fmt::format("camera 7: {}", key)));
  }
  for (const char* key : {"center", "radial_distortion", "translation", "res_w"}) {
    Json file = Json::array({human_video_pose("7")});
    file[0].erase(key);
    EXPECT_THAT(files.refusal(file), HasSubstr(fmt::format("camera 7: {}", key)));
  }
  EXPECT_THAT(files.refusal({{"7", human_lens()}}), HasSubstr("no camera has a pose"));
  EXPECT_THAT(files.refusal({{"S1", {Json::object()}}}), HasSubstr("no camera has a pose"));
  EXPECT_THAT(files.refusal(7), HasSubstr("must hold cameras"));
}

// ---- ActorsHQ ----

/// A camera at (1, 2, 3) m that looks along +x with y down (a quarter turn about y), and one that is not turned.
constexpr const char* kActorsHq =
    "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\n"
    "Cam001,4000,3000,0,1.5707963267948966,0,1,2,3,2,2.5,0.5,0.25\n"
    "Cam002,400,300,0,0,0,0,0,-1,2,2.5,0.5,0.5\n";

TEST(ActorsHqCalibrationReference, FractionsOfTheImageAndWorldFromCamera) {
  Files files(make_actorshq_calibration);
  const Calibration found = files.read_text(kActorsHq);
  EXPECT_EQ(found.unit, "m");
  EXPECT_EQ(found.up, "");
  ASSERT_EQ(found.cameras.size(), 2u);
  EXPECT_EQ(found.cameras[0].name, "Cam001");
  EXPECT_LT((found.cameras[0].centre() - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  // 4 forward (+x), 0.2 down (+y), 0.5 right (-z)
  expect_pixel(found.cameras[0], {5, 2.2, 2.5}, {2000 + 8000 * 0.125, 750 + 7500 * 0.05});
}

TEST(ActorsHqCalibrationRejects, WhatTablesGetWrong) {
  Files files(make_actorshq_calibration);
  const auto refusal = [&](const char* from, const char* to) {
    return message_of<FileError>([&] { files.read_text(support::replaced(kActorsHq, from, to)); });
  };
  EXPECT_THAT(refusal("rx,ry", "ry,rx"), HasSubstr("the first line must be"));
  EXPECT_THAT(refusal("4000,3000", "4000.5,3000"), AllOf(HasSubstr(":2:"), HasSubstr("w must be an integer")));
  EXPECT_THAT(refusal(",3,2,2.5", ",3,2,nan"), HasSubstr("fy of camera Cam001 must be finite"));
  EXPECT_THAT(refusal(",0.5,0.25\n", ",0.5\n"), HasSubstr("12 columns"));
}

// ---- all ----

struct Sample {
  Maker make;
  std::string text;
};

std::vector<Sample> samples() {
  return {{make_transforms_calibration, circle(true, false).dump(1)},
          {make_gaussian_splatting_calibration, splatting().dump(1)},
          {make_panoptic_calibration, panoptic().dump(1)},
          {make_shelf_calibration, shelf().dump(1)},
          {make_aist_calibration, aist().dump(1)},
          {make_human36m_calibration, human_parameters().dump(1)},
          {make_human36m_calibration, Json{{"54138969", human_camera(false)}}.dump(1)},
          {make_human36m_calibration, Json::array({human_video_pose("54138969")}).dump(1)},
          {make_actorshq_calibration, kActorsHq}};
}

TEST(JsonCalibrationsReference, EachFormatRecognisesItsFilesAlone) {
  for (const Sample& file : samples()) {
    for (const Sample& other : samples()) {
      const auto format = other.make();
      EXPECT_EQ(format->recognises({"x", file.text, false}), format->name() == file.make()->name())
          << format->name() << ":\n"
          << file.text;
      EXPECT_FALSE(format->recognises({".", "", true}));
    }
  }
}

TEST(JsonCalibrationsReference, FilesOfOtherProgramsAreNotRecognised) {
  const char* const others[] = {"",
                                "[",
                                "{",
                                "[]",
                                "{}",
                                "\xEF\xBB\xBF",
                                "7",
                                "name,w,h\n",
                                R"({"cam0": {"K": {"type_id": "opencv-matrix", "rows": 3}, "R": [1], "t": [0]}})",
                                R"([{"image_id": 1, "keypoints": [1, 2, 3], "score": 1}])",
                                R"({"people": [{"pose_keypoints_2d": [1, 2, 0.5]}]})"};
  for (const Sample& sample : samples())
    for (const char* other : others) EXPECT_FALSE(sample.make()->recognises({"x", other, false})) << other;
}

TEST(JsonCalibrationsRejects, HostileFiles) {
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.make()->name());
    Files(sample.make).expect_survives(sample.text);
  }
}

}  // namespace
}  // namespace doppel::json_calibrations_test
