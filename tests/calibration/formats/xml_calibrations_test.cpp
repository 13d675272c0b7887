#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>

#include "calibration/formats/source_of.h"
#include "doppel/calibration/formats/format.h"
#include "doppel/calibration/formats/inverse_lens.h"
#include "doppel/calibration/formats/relative_intrinsics.h"
#include "doppel/calibration/formats/rig_parts.h"
#include "doppel/calibration/formats/xml_parts.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/ring_of_cameras.h"
#include "support/temporary_folder.h"

namespace doppel::xml_calibrations_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using support::replaced;
using support::source_of;
using support::TemporaryFolder;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using Maker = std::unique_ptr<CalibrationFormat> (*)();

const Maker kMakers[] = {make_qualisys_calibration,  make_vicon_calibration,          make_optitrack_calibration,
                         make_metashape_calibration, make_realitycapture_calibration, make_captury_calibration};

Calibration read(Maker make, const fs::path& path) { return make()->read(source_of(path)); }

Calibration read_text(Maker make, const std::string& text, const std::string& name = "file.txt") {
  const TemporaryFolder folder;
  support::write_bytes(folder / name, text);
  return read(make, folder / name);
}

std::string refusal(Maker make, const std::string& text) {
  return message_of<FileError>([&] { read_text(make, text); });
}

void expect_hostile(Maker make, const std::string& valid, std::size_t density = 60) {
  const TemporaryFolder folder;
  const auto format = make();
  support::expect_survives_hostile_files(
      folder / "hostile.file", valid,
      [&](const fs::path& path) {
        const CalibrationSource source = source_of(path);
        (void)format->recognises(source);
        format->read(source);
      },
      density);
}

/// Six cameras around a point near the origin, metres, z up.
std::vector<PinholeCamera> rig() {
  std::vector<PinholeCamera> cameras = ring_of_cameras(6, 1000, {0.1, 0.9, -0.2});
  Eigen::Matrix3d y_up_from_z_up;
  y_up_from_z_up << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  for (PinholeCamera& camera : cameras) camera.R = camera.R * y_up_from_z_up;
  return cameras;
}

std::string attributes(const char* prefix, const Eigen::Matrix3d& m, int first) {
  std::string text;
  for (int i = 0; i < 9; ++i) {
    const std::string index = first == 1 ? fmt::format("{}{}", i / 3 + 1, i % 3 + 1) : std::to_string(i);
    text += fmt::format("{}{}=\"{:.17g}\" ", prefix, index, m(i / 3, i % 3));
  }
  return text;
}

std::string numbers_of(const Eigen::MatrixXd& m) {
  std::string text;
  for (Eigen::Index row = 0; row < m.rows(); ++row)
    for (Eigen::Index column = 0; column < m.cols(); ++column) text += fmt::format("{:.17g} ", m(row, column));
  return text;
}

void expect_same_poses(const std::vector<Camera>& found, const std::vector<PinholeCamera>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_LT((found[i].R - expected[i].R).norm(), 1e-9) << found[i].name;
    EXPECT_LT((found[i].centre() - expected[i].centre()).norm(), 1e-9) << found[i].name;
  }
}

const Eigen::Matrix3d kFlip = Eigen::Vector3d(1, -1, -1).asDiagonal();

// ---------------------------------------------------------------------------------------------------------- Qualisys

constexpr const char* kQualisysIntrinsic =
    R"(<intrinsic focallength="8" sensorMinU="0" sensorMaxU="81856" sensorMinV="0" sensorMaxV="65472" )"
    R"(focalLengthU="64064" focalLengthV="64128" centerPointU="41600" centerPointV="32320" skew="0" )"
    R"(radialDistortion1="-0.05" radialDistortion2="0.12" radialDistortion3="0.03" tangentalDistortion1="0.001" )"
    R"(tangentalDistortion2="-0.002"/>)";

std::string qualisys_camera_text(const std::string& serial, const Eigen::Matrix3d& m, const Eigen::Vector3d& position,
                                 const std::string& intrinsic = kQualisysIntrinsic, const char* fov = "",
                                 const char* model = "Miqus Video") {
  const Eigen::Vector3d mm = 1000.0 * position;
  return fmt::format(
      "<camera active=\"1\" serial=\"{}\" model=\"{}\" viewrotation=\"0\">{}\n<transform {}x=\"{:.17g}\" y=\"{:.17g}\" "
      "z=\"{:.17g}\"/>\n{}\n</camera>\n",
      serial, model, fov, attributes("r", m, 1), mm.x(), mm.y(), mm.z(), intrinsic);
}

std::string qualisys_file(const std::string& cameras) {
  return "<?xml version=\"1.0\"?>\n<calibration type=\"regular\">\n<cameras>\n" + cameras +
         "</cameras>\n</calibration>\n";
}

/// All cameras of the rig. @param pose writes M and x y z of a camera
std::string qualisys_rig(const std::function<std::pair<Eigen::Matrix3d, Eigen::Vector3d>(const Camera&)>& pose,
                         const std::string& intrinsic = kQualisysIntrinsic) {
  std::string text;
  for (const PinholeCamera& camera : rig())
    text += qualisys_camera_text(camera.name, pose(camera).first, pose(camera).second, intrinsic);
  return qualisys_file(text);
}

std::string qualisys_valid() {
  return qualisys_rig([](const Camera& camera) { return std::pair(kFlip * camera.R, camera.centre()); });
}

TEST(Qualisys, LengthsInTheImageArePartsOfPixelsAndThoseOfTheWorldMillimetres) {
  Eigen::Matrix3d m;  // x right, y up, z backward: the camera looks along -z of the world
  m.setIdentity();
  const Calibration found =
      read_text(make_qualisys_calibration,
                qualisys_file(qualisys_camera_text("a7", m, {0.5, 1.5, 4.0}, kQualisysIntrinsic,
                                                   R"(<fov_video left="10" top="20" right="1209" bottom="819"/>)")));
  EXPECT_EQ(found.unit, "mm");
  EXPECT_EQ(found.up, "+z");
  ASSERT_EQ(found.cameras.size(), 1u);
  const Camera& camera = found.cameras[0];
  EXPECT_EQ(camera.name, "a7");
  EXPECT_EQ(camera.width, 1200);
  EXPECT_EQ(camera.height, 800);
  // focal lengths 64064 / 64 and 64128 / 64; centre 41600 / 64 - 10 and 32320 / 64 - 20, plus half a pixel
  Eigen::Matrix3d K;
  K << 1001, 0, 640.5, 0, 1002, 485.5, 0, 0, 1;
  EXPECT_EQ(camera.K, K);
  EXPECT_EQ(camera.lens, Lens::opencv);
  EXPECT_THAT(std::vector<double>(camera.distortion.begin(), camera.distortion.begin() + 5),
              ::testing::ElementsAre(-0.05, 0.12, 0.001, -0.002, 0.03));
  // Without distortion: right by 0.4 of depth 2 is 0.2 to the right, up by 0.6 is 0.3 to the top.
  const Eigen::Vector2d pixel = without_distortion(camera).project({0.9, 2.1, 2.0});
  EXPECT_NEAR(pixel.x(), 640.5 + 1001 * 0.2, 1e-9);
  EXPECT_NEAR(pixel.y(), 485.5 - 1002 * 0.3, 1e-9);
}

TEST(Qualisys, TheSizeComesFromTheSensorWhenTheFieldOfViewIsMissing) {
  const Calibration found = read_text(make_qualisys_calibration, qualisys_valid());
  EXPECT_EQ(found.cameras[0].width, 1279);  // 81856 / 64
  EXPECT_EQ(found.cameras[0].height, 1023);
}

TEST(Qualisys, TheCameraStandsAtXYZ) {
  const Calibration found = read_text(make_qualisys_calibration, qualisys_valid());
  expect_same_poses(found.cameras, rig());
  EXPECT_THAT(found.notes, IsEmpty());
}

TEST(Qualisys, TheiaWritesTheTranslationAndPixels) {
  std::string intrinsic = replaced(kQualisysIntrinsic, "\"81856\"", "\"1280\"");
  intrinsic = replaced(replaced(intrinsic, "\"65472\"", "\"1024\""), "\"64064\"", "\"1001\"");
  intrinsic = replaced(replaced(intrinsic, "\"41600\"", "\"650\""), "tangentalDistortion1", "tangentialDistortion1");
  const Calibration found =
      read_text(make_qualisys_calibration,
                qualisys_rig([](const Camera& camera) { return std::pair(camera.R, camera.t); }, intrinsic));
  expect_same_poses(found.cameras, rig());
  EXPECT_EQ(found.cameras[0].width, 1280);
  EXPECT_EQ(found.cameras[0].K(0, 0), 1001.0);
  EXPECT_EQ(found.cameras[0].K(0, 2), 650.5);
  EXPECT_EQ(found.cameras[0].distortion[2], 0.001);
  EXPECT_THAT(found.notes, ::testing::ElementsAre(HasSubstr("translation")));
}

TEST(Qualisys, ATranslationIsFoundInAnyAxesOfTheCamera) {
  const auto in_its_axes = qualisys_rig([](const Camera& camera) {
    return std::pair<Eigen::Matrix3d, Eigen::Vector3d>(kFlip * camera.R, kFlip * camera.t);
  });
  expect_same_poses(read_text(make_qualisys_calibration, in_its_axes).cameras, rig());
  const auto downward = qualisys_rig(
      [](const Camera& camera) { return std::pair<Eigen::Matrix3d, Eigen::Vector3d>(kFlip * camera.R, camera.t); });
  expect_same_poses(read_text(make_qualisys_calibration, downward).cameras, rig());
}

TEST(Qualisys, CamerasForMarkersAndUncalibratedOnesAreLeftOutAndCounted) {
  const Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
  const auto camera = [&](const char* serial, const char* model) {
    return qualisys_camera_text(serial, m, {0, 0, 1}, kQualisysIntrinsic, "", model);
  };
  const std::string text =
      qualisys_file(camera("1", "Miqus Video") + camera("2", "Miqus M3") + camera("3", "Oqus 210c") +
                    "<camera active=\"0\" serial=\"4\"/>\n<camera active=\"1\" serial=\"5\" calibrated=\"false\"/>\n");
  const Calibration found = read_text(make_qualisys_calibration, text);
  ASSERT_EQ(found.cameras.size(), 2u);
  EXPECT_EQ(found.cameras[1].name, "3");
  EXPECT_THAT(found.notes, Contains(HasSubstr("1 cameras for markers")));
  EXPECT_THAT(found.notes, Contains(HasSubstr("2 cameras that are inactive")));
  const Calibration markers = read_text(make_qualisys_calibration, qualisys_file(camera("2", "Miqus M3")));
  EXPECT_EQ(markers.cameras.size(), 1u);
  EXPECT_THAT(markers.notes, Contains(HasSubstr("no video camera")));
}

TEST(Qualisys, ErrorsNameTheCameraTheKeyAndTheLine) {
  const std::string valid = qualisys_valid();
  const std::string missing = refusal(make_qualisys_calibration, replaced(valid, "focalLengthU", "otherLength"));
  EXPECT_THAT(missing, HasSubstr("file.txt:6: reading a camera calibration: camera c0: focalLengthU is missing"));
  EXPECT_THAT(refusal(make_qualisys_calibration, replaced(valid, "r12=\"", "r12=\"x")), HasSubstr("r12 is \"x"));
  EXPECT_THAT(refusal(make_qualisys_calibration, replaced(valid, "skew=\"0\"", "skew=\"0.5\"")), HasSubstr("skew"));
  EXPECT_THAT(refusal(make_qualisys_calibration, replaced(valid, "\"81856\"", "\"1e200\"")), HasSubstr("pixels"));
  EXPECT_THAT(refusal(make_qualisys_calibration, qualisys_file("")), HasSubstr("no calibrated <camera>"));
  expect_hostile(make_qualisys_calibration, valid);
}

// ------------------------------------------------------------------------------------------------------------- Vicon

std::string vicon_camera_text(const std::string& id, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& position,
                              const char* lens = "", const char* type = "VideoInputDevice:Any") {
  const Eigen::Quaterniond q(rotation);
  return fmt::format(
      "  <Camera DEVICEID=\"{}\" DISPLAY_TYPE=\"{}\" PIXEL_ASPECT_RATIO=\"1\" SENSOR_SIZE=\"1600 1200\">\r\n"
      "    <KeyFrames>\r\n      <KeyFrame FOCAL_LENGTH=\"1500.5\" ORIENTATION=\"{:.17g} {:.17g} {:.17g} {:.17g}\" "
      "POSITION=\"{}\" PRINCIPAL_POINT=\"801.25 598.75\" {}/>\r\n    </KeyFrames>\r\n  </Camera>\r\n",
      id, type, q.x(), q.y(), q.z(), q.w(), numbers_of(1000.0 * position.transpose()), lens);
}

std::string vicon_file(const std::string& cameras) {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"no\" ?>\r\n<Cameras VERSION=\"2.0\">\r\n" + cameras +
         "</Cameras>\r\n";
}

std::string vicon_rig(bool transposed, const char* lens = "") {
  std::string text;
  for (const PinholeCamera& camera : rig())
    text += vicon_camera_text(camera.name, transposed ? camera.R.transpose() : camera.R, camera.centre(), lens);
  return vicon_file(text);
}

TEST(Vicon, TheRealPartOfTheQuaternionIsLast) {
  // A quarter turn about x: world (x, y, z) -> camera (x, -z, y), so the camera looks along +y with z up.
  const std::string text = replaced(vicon_file(vicon_camera_text("51", Eigen::Matrix3d::Identity(), {0.2, -3.0, 1.1})),
                                    "ORIENTATION=\"0 0 0 1\"", "ORIENTATION=\"1 0 0 1\"");
  const Calibration found = read_text(make_vicon_calibration, text);
  EXPECT_EQ(found.unit, "mm");
  EXPECT_EQ(found.up, "+z");
  ASSERT_EQ(found.cameras.size(), 1u);
  const Camera& camera = found.cameras[0];
  EXPECT_EQ(camera.name, "51");
  EXPECT_EQ(camera.width, 1600);
  EXPECT_EQ(camera.height, 1200);
  // 0.4 to the right and 0.5 up at depth 2
  const Eigen::Vector2d pixel = camera.project({0.6, -1.0, 1.6});
  EXPECT_NEAR(pixel.x(), 801.25 + 1500.5 * 0.2, 1e-9);
  EXPECT_NEAR(pixel.y(), 598.75 - 1500.5 * 0.25, 1e-9);
}

TEST(Vicon, TheSenseOfTheRotationIsTheOneWithWhichAllCamerasLookAtOnePoint) {
  const Calibration usual = read_text(make_vicon_calibration, vicon_rig(false));
  expect_same_poses(usual.cameras, rig());
  EXPECT_THAT(usual.notes, IsEmpty());
  const Calibration transposed = read_text(make_vicon_calibration, vicon_rig(true));
  expect_same_poses(transposed.cameras, rig());
  EXPECT_THAT(transposed.notes, Contains(HasSubstr("from the camera to the world")));
}

TEST(Vicon, TheRadialTermsAreLeftOutWithTheirSize) {
  // The farthest corner is 801.25 and 601.25 away: 1e-8 r^3 = 10.05 pixels.
  const char* const terms = R"(VICON_RADIAL="9 9" VICON_RADIAL2="ViconRadial2 801.25 598.75 1e-08 0 0")";
  const Calibration found = read_text(make_vicon_calibration, vicon_rig(false, terms));
  EXPECT_FALSE(found.cameras[0].has_distortion());
  EXPECT_THAT(found.notes, Contains(::testing::AllOf(HasSubstr("radial terms"), HasSubstr("up to 10.1 pixels"))));
  const Calibration without =
      read_text(make_vicon_calibration, vicon_rig(false, R"(VICON_RADIAL2="Vicon3Parameter 1 2 0 0 0")"));
  EXPECT_THAT(without.notes, IsEmpty());
  EXPECT_THAT(refusal(make_vicon_calibration, vicon_rig(false, R"(VICON_RADIAL="1e-08")")), HasSubstr("VICON_RADIAL"));
}

TEST(Vicon, CamerasForMarkersAndThoseWithoutAKeyFrameAreLeftOut) {
  const Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  const Calibration found =
      read_text(make_vicon_calibration,
                vicon_file(vicon_camera_text("1", R, {0, 0, 1}) + vicon_camera_text("2", R, {0, 0, 2}, "", "Vero 2.2") +
                           "  <Camera DEVICEID=\"3\"><KeyFrames/></Camera>\r\n"));
  ASSERT_EQ(found.cameras.size(), 1u);
  EXPECT_EQ(found.cameras[0].name, "1");
  EXPECT_THAT(found.notes, Contains(HasSubstr("1 cameras for markers")));
  EXPECT_THAT(found.notes, Contains(HasSubstr("1 cameras without a key frame")));
}

TEST(Vicon, MovingCamerasAndMissingValuesAreRefused) {
  const std::string valid = vicon_rig(false);
  EXPECT_THAT(refusal(make_vicon_calibration, replaced(valid, "<KeyFrames>", "<KeyFrames><KeyFrame/>")),
              HasSubstr("camera c0: it has 2 key frames"));
  EXPECT_THAT(refusal(make_vicon_calibration, replaced(valid, "FOCAL_LENGTH", "F")),
              HasSubstr("file.txt:5: reading a camera calibration: camera c0: FOCAL_LENGTH is missing"));
  EXPECT_THAT(refusal(make_vicon_calibration, replaced(valid, "801.25 598.75", "801.25")),
              HasSubstr("PRINCIPAL_POINT is \"801.25\", expected 2 numbers"));
  EXPECT_THAT(refusal(make_vicon_calibration, replaced(valid, "1600 1200", "1e9 1200")), HasSubstr("SENSOR_SIZE"));
  expect_hostile(make_vicon_calibration, valid);
}

// --------------------------------------------------------------------------------------------------------- OptiTrack

constexpr const char* kOptitrackNoLens = R"(k1="0" k2="0" k3="0" TangentialX="0" TangentialY="0")";

std::string optitrack_camera_text(const std::string& serial, const Eigen::Matrix3d& world_from_camera,
                                  const Eigen::Vector3d& position, const char* lens = kOptitrackNoLens) {
  return fmt::format(
      "<Camera Serial=\"{}\"><Properties CameraID=\"1\"/><Attributes ImagerPixelWidth=\"1200\" "
      "ImagerPixelHeight=\"1000\"/>\n<Intrinsic HorizontalFocalLength=\"1\" k1=\"7\"/>\n<IntrinsicStandardCameraModel "
      "LensCenterX=\"610.5\" LensCenterY=\"495.25\" HorizontalFocalLength=\"1100\" VerticalFocalLength=\"1105\" {}/>\n"
      "<Extrinsic X=\"{:.17g}\" Y=\"{:.17g}\" Z=\"{:.17g}\" {}/></Camera>\n",
      serial, lens, position.x(), position.y(), position.z(), attributes("OrientMatrix", world_from_camera, 0));
}

std::string optitrack_file(const std::string& cameras) {
  return "<?xml version=\"1.0\" encoding=\"UTF-16LE\"?>\n<calibrationProfile version=\"1\">\n<MotiveBuildInfo/>\n"
         "<Calibration><Cameras>\n" +
         cameras + "</Cameras></Calibration>\n</calibrationProfile>\n";
}

std::string optitrack_valid(const char* lens = kOptitrackNoLens) {
  return optitrack_file(optitrack_camera_text("M1", Eigen::Matrix3d::Identity(), {0.3, 1.2, 5.0}, lens));
}

TEST(Optitrack, TheCameraLooksAlongMinusZOfItsMatrix) {
  const Calibration found = read_text(make_optitrack_calibration, optitrack_valid());
  EXPECT_EQ(found.unit, "m");
  EXPECT_EQ(found.up, "+y");
  EXPECT_THAT(found.notes, IsEmpty());
  ASSERT_EQ(found.cameras.size(), 1u);
  const Camera& camera = found.cameras[0];
  EXPECT_EQ(camera.name, "M1");
  EXPECT_EQ(camera.width, 1200);
  EXPECT_FALSE(camera.has_distortion());
  const Eigen::Vector2d pixel = camera.project({0.7, 1.8, 3.0});  // right 0.4, up 0.6, depth 2
  EXPECT_NEAR(pixel.x(), 610.5 + 1100 * 0.2, 1e-9);
  EXPECT_NEAR(pixel.y(), 495.25 - 1105 * 0.3, 1e-9);
}

TEST(Optitrack, TheMatrixLeadsFromTheCameraToTheWorld) {
  std::string text;
  for (const PinholeCamera& camera : rig())
    text += optitrack_camera_text(camera.name, camera.R.transpose() * kFlip, camera.centre());
  expect_same_poses(read_text(make_optitrack_calibration, optitrack_file(text)).cameras, rig());
}

TEST(Optitrack, TheLensLeadsFromTheDistortedPointToTheOther) {
  const double k1 = 0.09, k2 = -0.08, k3 = 0.002, tx = 0.0002, ty = -0.0001;
  const Calibration found =
      read_text(make_optitrack_calibration,
                optitrack_valid(R"(k1="0.09" k2="-0.08" k3="0.002" TangentialX="0.0002" TangentialY="-0.0001")"));
  EXPECT_THAT(found.notes, ::testing::ElementsAre(HasSubstr("with a residual of at most 0.0")));
  const Camera& camera = found.cameras[0];
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(0, 0), Eigen::Vector2d(1200, 1000), Eigen::Vector2d(700, 100)}) {
    const double x = (pixel.x() - 610.5) / 1100, y = (pixel.y() - 495.25) / 1105, r2 = x * x + y * y;
    const double radial = 1 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
    const double straight_x = x * radial + 2 * tx * x * y + ty * (r2 + x * x);
    const double straight_y = y * radial + 2 * ty * x * y + tx * (r2 + y * y);
    // A point on that ray, at depth 3 in front of the camera at (0.3, 1.2, 5).
    const Eigen::Vector2d projected = camera.project({0.3 + 3 * straight_x, 1.2 - 3 * straight_y, 2.0});
    EXPECT_LT((projected - pixel).norm(), 0.1);
  }
}

TEST(Optitrack, Utf16IsRead) {
  const std::string text = optitrack_valid();
  std::string wide = "\xFF\xFE";
  for (const char c : text) wide += std::string{c, '\0'};
  EXPECT_EQ(read_text(make_optitrack_calibration, wide).cameras.size(), 1u);
  EXPECT_TRUE(make_optitrack_calibration()->recognises({"", wide.substr(0, 300), false}));
}

TEST(Optitrack, LensesWithoutAnInverseAndMissingValuesAreRefused) {
  const auto lens = [](const char* terms) { return refusal(make_optitrack_calibration, optitrack_valid(terms)); };
  EXPECT_THAT(lens(R"(k1="-2" k2="0" k3="0" TangentialX="0" TangentialY="0")"), HasSubstr("no inverse"));
  EXPECT_THAT(lens(R"(k1="1e200" k2="0" k3="0" TangentialX="0" TangentialY="0")"), HasSubstr("camera M1"));
  EXPECT_THAT(lens(R"(k1="0" k2="0" k3="0" TangentialX="0.02" TangentialY="0.02")"), HasSubstr("allowed are 0.1"));
  const std::string valid = optitrack_valid();
  EXPECT_THAT(refusal(make_optitrack_calibration, replaced(valid, "OrientMatrix4", "Other")),
              HasSubstr("camera M1: OrientMatrix4 is missing"));
  EXPECT_THAT(refusal(make_optitrack_calibration, replaced(valid, "IntrinsicStandardCameraModel", "Other")),
              HasSubstr("no element <IntrinsicStandardCameraModel>"));
  const Calibration one = read_text(
      make_optitrack_calibration,
      optitrack_file("<Camera Serial=\"e\"/>" + optitrack_camera_text("M2", Eigen::Matrix3d::Identity(), {0, 0, 0})));
  EXPECT_THAT(one.notes, Contains(HasSubstr("1 cameras without <Extrinsic>")));
  expect_hostile(make_optitrack_calibration, valid);
  expect_hostile(make_optitrack_calibration,
                 optitrack_valid(R"(k1="0.02" k2="0" k3="0" TangentialX="0" TangentialY="0")"), 6);
}

// --------------------------------------------------------------------------------------------------------- Metashape

constexpr const char* kMetashapeCalibration =
    "<calibration type=\"frame\" class=\"initial\"><f>1</f></calibration>\n"
    "<calibration type=\"frame\" class=\"adjusted\"><resolution width=\"4000\" height=\"3000\"/><f>3500</f><cx>12</cx>"
    "<cy>-7</cy><b1>2</b1><b2>0.5</b2><k1>-0.1</k1><k2>0.02</k2><k3>0.003</k3><k4>0.0004</k4><p1>0.001</p1>"
    "<p2>-0.002</p2></calibration>\n";
constexpr const char* kMetashapeTransform =
    "<transform><rotation>0 -1 0 1 0 0 0 0 1</rotation><translation>10 20 30</translation><scale>2</scale></transform>";

std::string metashape_camera(int id, const std::string& label, const char* transform) {
  return fmt::format("<camera id=\"{}\" sensor_id=\"3\" component_id=\"0\" label=\"{}\">{}</camera>\n", id, label,
                     transform);
}

std::string metashape_file(const std::string& cameras, const char* chunk_transform = kMetashapeTransform,
                           const std::string& calibration = kMetashapeCalibration, const char* component = "") {
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<document version=\"2.0.0\">\n<chunk label=\"a\">\n<sensors>\n"
      "<sensor id=\"3\" label=\"s\" type=\"frame\">\n<resolution width=\"40\" "
      "height=\"30\"/>\n{}</sensor>\n</sensors>\n"
      "<components><component id=\"0\">{}</component></components>\n<cameras>\n{}</cameras>\n{}\n</chunk>\n"
      "</document>\n",
      calibration, component, cameras, chunk_transform);
}

// Turned so that x -> x, y -> -z, z -> y, at (1, 2, 3) of the chunk.
constexpr const char* kMetashapePose = "<transform>1 0 0 1 0 0 1 2 0 -1 0 3 0 0 0 1</transform>";

TEST(Metashape, IntrinsicsAreOffsetsAndTheTangentialTermsAreSwapped) {
  const Calibration found =
      read_text(make_metashape_calibration, metashape_file(metashape_camera(0, "left", kMetashapePose)));
  EXPECT_EQ(found.unit, "m");
  EXPECT_EQ(found.up, "+z");
  EXPECT_THAT(found.notes, IsEmpty());
  ASSERT_EQ(found.cameras.size(), 1u);
  const Camera& camera = found.cameras[0];
  EXPECT_EQ(camera.name, "left");
  EXPECT_EQ(camera.width, 4000);
  Eigen::Matrix3d K;
  K << 3502, 0.5, 2012, 0, 3500, 1493, 0, 0, 1;
  EXPECT_EQ(camera.K, K);
  EXPECT_EQ(camera.lens, Lens::polynomial);
  EXPECT_THAT(std::vector<double>(camera.distortion.begin(), camera.distortion.begin() + 6),
              ::testing::ElementsAre(-0.1, 0.02, -0.002, 0.001, 0.003, 0.0004));
  // The vendor's formula with the vendor's p1 and p2.
  const double x = 0.2, y = -0.3, r2 = x * x + y * y, p1 = 0.001, p2 = -0.002;
  const double radial = 1 + r2 * (-0.1 + r2 * (0.02 + r2 * (0.003 + r2 * 0.0004)));
  const Eigen::Vector2d distorted = camera.distorted({x, y});
  EXPECT_NEAR(distorted.x(), x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y, 1e-15);
  EXPECT_NEAR(distorted.y(), y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y, 1e-15);
}

TEST(Metashape, ALensWithoutTheFourthCoefficientIsOpenCvs) {
  const std::string calibration = replaced(kMetashapeCalibration, "<k4>0.0004</k4>", "");
  const Calibration found =
      read_text(make_metashape_calibration,
                metashape_file(metashape_camera(0, "left", kMetashapePose), kMetashapeTransform, calibration));
  EXPECT_EQ(found.cameras.at(0).lens, Lens::opencv);
  EXPECT_THAT(std::vector<double>(found.cameras[0].distortion.begin(), found.cameras[0].distortion.begin() + 5),
              ::testing::ElementsAre(-0.1, 0.02, -0.002, 0.001, 0.003));
}

TEST(Metashape, EveryReferenceButALocalOneIsTheEarths) {
  const auto up_with = [](const std::string& reference) {
    return read_text(make_metashape_calibration,
                     metashape_file(metashape_camera(0, "left", kMetashapePose),
                                    (kMetashapeTransform + ("<reference>" + reference + "</reference>")).c_str()))
        .up;
  };
  EXPECT_EQ(up_with("LOCAL_CS[&quot;Local Coordinates (m)&quot;]"), "+z");
  for (const char* earth :
       {"GEOGCS[&quot;WGS 84&quot;]", "PROJCS[&quot;WGS 84 / UTM zone 32N&quot;]", "COMPD_CS[&quot;a&quot;]"})
    EXPECT_EQ(up_with(earth), "") << earth;
}

TEST(Metashape, ThePoseGoesThroughTheScaledFrameOfTheChunk) {
  const Calibration found =
      read_text(make_metashape_calibration, metashape_file(metashape_camera(0, "left", kMetashapePose)));
  // Centre: (10, 20, 30) + 2 (-2, 1, 3). The view, +y of the chunk, is -x of the world; down is -z.
  const Camera& camera = found.cameras[0];
  EXPECT_LT((camera.centre() - Eigen::Vector3d(6, 22, 36)).norm(), 1e-12);
  EXPECT_LT((camera.R.row(2).transpose() - Eigen::Vector3d(-1, 0, 0)).norm(), 1e-12);
  EXPECT_LT((camera.R.row(1).transpose() - Eigen::Vector3d(0, 0, -1)).norm(), 1e-12);
}

TEST(Metashape, TheComponentGivesTheFrameWhenTheChunkHasNone) {
  const std::string cameras = metashape_camera(0, "left", kMetashapePose);
  const Calibration component =
      read_text(make_metashape_calibration, metashape_file(cameras, "", kMetashapeCalibration, kMetashapeTransform));
  EXPECT_LT((component.cameras[0].centre() - Eigen::Vector3d(6, 22, 36)).norm(), 1e-12);
  EXPECT_EQ(component.unit, "m");
  const Calibration none = read_text(make_metashape_calibration, metashape_file(cameras, ""));
  EXPECT_LT((none.cameras[0].centre() - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  EXPECT_EQ(none.unit, "");
  EXPECT_EQ(none.up, "");
}

TEST(Metashape, CamerasThatAreNotAlignedAreCountedAndLabelsBecomeUnique) {
  const Calibration found =
      read_text(make_metashape_calibration,
                metashape_file(metashape_camera(0, "a", kMetashapePose) + metashape_camera(1, "b", "") +
                               "<group id=\"0\">" + metashape_camera(2, "a", kMetashapePose) + "</group>"));
  ASSERT_EQ(found.cameras.size(), 2u);
  EXPECT_EQ(found.cameras[1].name, "a_2");
  EXPECT_THAT(found.notes, Contains(HasSubstr("1 cameras that are not aligned")));
  EXPECT_THAT(found.notes, Contains(HasSubstr("1 cameras with the label of another")));
}

/// A rig: the master with the pose has the sensor 3, the other camera the sensor 4 with this offset.
std::string metashape_rig(const std::string& cameras, const std::string& offset, const std::string& of_master = "") {
  const std::string file = metashape_file(cameras);
  const std::string sensor = file.substr(file.find("<sensor id"), file.find("</sensors>") - file.find("<sensor id"));
  const std::string other =
      replaced(replaced(sensor, "id=\"3\"", "id=\"4\" master_id=\"3\""), "</sensor>", offset + "</sensor>");
  return replaced(replaced(file, "</sensor>", of_master + "</sensor>"), "</sensors>", other + "</sensors>");
}
// A quarter turn about the master's z: x of the camera is y of the master. The camera is 2 to the right, 3 ahead.
constexpr const char* kMetashapeOffset =
    "<rotation locked=\"true\">0 -1 0 1 0 0 0 0 1</rotation><location locked=\"true\">2 0 3</location>";
constexpr const char* kMetashapeSlave = "<camera id=\"1\" sensor_id=\"4\" master_id=\"0\" label=\"slave\"/>\n";

TEST(Metashape, ACameraOfARigHasThePoseOfItsMasterTimesThatOfItsSensor) {
  const std::string master = metashape_camera(0, "left", kMetashapePose);
  // The master's right is +x of the chunk, its view +y: the centre in the chunk is (1, 2, 3) + (2, 3, 0). The chunk
  // turns x to y and y to -x, and doubles: (10, 20, 30) + 2 (-5, 3, 3).
  for (const std::string& cameras : {master + kMetashapeSlave, kMetashapeSlave + master,
                                     kMetashapeSlave + ("<group id=\"0\">" + master + "</group>")}) {
    const Calibration found = read_text(make_metashape_calibration, metashape_rig(cameras, kMetashapeOffset));
    EXPECT_THAT(found.notes, IsEmpty());
    ASSERT_EQ(found.cameras.size(), 2u);
    const Camera& camera = found.cameras[found.cameras[0].name == "slave" ? 0 : 1];
    EXPECT_EQ(camera.name, "slave");
    EXPECT_LT((camera.centre() - Eigen::Vector3d(0, 26, 36)).norm(), 1e-12);
    // The view stays; the camera's x is the master's y, which is down.
    EXPECT_LT((camera.R.row(2).transpose() - Eigen::Vector3d(-1, 0, 0)).norm(), 1e-12);
    EXPECT_LT((camera.R.row(0).transpose() - Eigen::Vector3d(0, 0, -1)).norm(), 1e-12);
  }
}

TEST(Metashape, APoseOfItsOwnIsTakenAlsoInARig) {
  const std::string cameras =
      metashape_camera(0, "left", kMetashapePose) +
      replaced(kMetashapeSlave, "/>", ">" + replaced(kMetashapePose, "0 1 2", "0 1 5") + "</camera>");
  const Calibration found = read_text(make_metashape_calibration, metashape_rig(cameras, kMetashapeOffset));
  EXPECT_LT((found.cameras[1].centre() - found.cameras[0].centre() - Eigen::Vector3d(-6, 0, 0)).norm(), 1e-12);
}

// In a rig that is built around another camera, the master of the photos has an offset of its own.
TEST(Metashape, TheOffsetOfTheMastersSensorIsTakenOut) {
  const std::string cameras = metashape_camera(0, "left", kMetashapePose) + kMetashapeSlave;
  const Calibration same =
      read_text(make_metashape_calibration, metashape_rig(cameras, kMetashapeOffset, kMetashapeOffset));
  EXPECT_LT((same.cameras[1].centre() - same.cameras[0].centre()).norm(), 1e-12);
  EXPECT_LT((same.cameras[1].R - same.cameras[0].R).norm(), 1e-12);
}

TEST(Metashape, ARigWithoutPosesOrOffsetsIsLeftOutAndSaysSo) {
  const std::string aligned = metashape_camera(7, "left", kMetashapePose);
  const auto notes = [&](const std::string& cameras, const std::string& offset) {
    return read_text(make_metashape_calibration, metashape_rig(cameras, offset)).notes;
  };
  EXPECT_THAT(notes(aligned + metashape_camera(0, "master", "") + kMetashapeSlave, kMetashapeOffset),
              ::testing::ElementsAre(HasSubstr("2 cameras that are not aligned")));
  EXPECT_THAT(notes(metashape_camera(0, "left", kMetashapePose) + kMetashapeSlave, ""),
              ::testing::ElementsAre(HasSubstr("1 cameras of a rig were left out")));
  EXPECT_THAT(refusal(make_metashape_calibration, metashape_rig(aligned + kMetashapeSlave, kMetashapeOffset)),
              HasSubstr("camera slave: its master_id is 0, but there is no <camera> with this id"));
  expect_hostile(make_metashape_calibration,
                 metashape_rig(metashape_camera(0, "left", kMetashapePose) + kMetashapeSlave, kMetashapeOffset));
}

TEST(Metashape, LargeCoordinatesAreMovedToTheOrigin) {
  const std::string cameras = metashape_camera(0, "left", kMetashapePose);
  const std::string far = replaced(kMetashapeTransform, "10 20 30", "500010.25 20 5000030");
  const Calibration found = read_text(make_metashape_calibration, metashape_file(cameras, far.c_str()));
  EXPECT_LT((found.cameras[0].centre() - Eigen::Vector3d(0.25, 0, 0)).norm(), 1e-8);
  EXPECT_THAT(found.notes, ::testing::ElementsAre(HasSubstr("(500006, 22, 5000036)")));
  const std::string near = replaced(kMetashapeTransform, "10 20 30", "99990 20 30");
  EXPECT_THAT(read_text(make_metashape_calibration, metashape_file(cameras, near.c_str())).notes, IsEmpty());
}

TEST(Metashape, FisheyeLensesAreReadAndOthersLeftOut) {
  const std::string cameras = metashape_camera(0, "left", kMetashapePose);
  std::string fisheye =
      replaced(kMetashapeCalibration, "type=\"frame\" class=\"adjusted\"", "type=\"fisheye\" class=\"adjusted\"");
  EXPECT_THAT(refusal(make_metashape_calibration, metashape_file(cameras, kMetashapeTransform, fisheye)),
              HasSubstr("camera left: a fisheye lens with p1 0.001"));
  fisheye = replaced(replaced(fisheye, "<p1>0.001</p1>", ""), "<p2>-0.002</p2>", "");
  const Calibration found =
      read_text(make_metashape_calibration, metashape_file(cameras, kMetashapeTransform, fisheye));
  EXPECT_EQ(found.cameras[0].lens, Lens::fisheye);
  EXPECT_EQ(found.cameras[0].distortion[3], 0.0004);
  const std::string spherical = replaced(fisheye, "type=\"fisheye\"", "type=\"spherical\"");
  EXPECT_THAT(refusal(make_metashape_calibration, metashape_file(cameras, kMetashapeTransform, spherical)),
              HasSubstr("1 cameras whose sensors are neither"));
}

TEST(Metashape, ErrorsNameTheCameraAndTheKey) {
  const std::string valid = metashape_file(metashape_camera(0, "left", kMetashapePose));
  const auto message = [&](const char* from, const char* to) {
    return refusal(make_metashape_calibration, replaced(valid, from, to));
  };
  EXPECT_THAT(message("<f>3500</f>", ""), HasSubstr("camera left: f is missing"));
  EXPECT_THAT(message("<p2>", "<p3>1</p3><p2>"), HasSubstr("p3 1"));
  EXPECT_THAT(message("sensor_id=\"3\"", "sensor_id=\"4\""), HasSubstr("no <sensor> with the id 4"));
  EXPECT_THAT(message("<scale>2</scale>", "<scale>-2</scale>"), HasSubstr("scale is -2"));
  EXPECT_THAT(message(" 0 0 0 1</transform>", "</transform>"), HasSubstr("expected 16 numbers"));
  expect_hostile(make_metashape_calibration, valid);
}

// ---------------------------------------------------------------------------------------------------- RealityCapture

// Looks along +y with z up, from (1, 2, 3).
std::string xmp(const std::string& model = "brown3t2", const std::string& lens = "-0.1 0.02 0.003 0 0.001 0.002") {
  return "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\">\n<rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\n"
         "<rdf:Description xcr:Version=\"3\" xcr:Coordinates=\"absolute\" xcr:DistortionModel=\"" +
         model +
         "\" xcr:FocalLength35mm=\"27\" xcr:Skew=\"0\" xcr:AspectRatio=\"1\" xcr:PrincipalPointU=\"0.01\" "
         "xcr:PrincipalPointV=\"-0.02\" xmlns:xcr=\"http://www.capturingreality.com/ns/xcr/1.1#\">\n"
         "<xcr:Rotation>1 0 0 0 0 -1 0 1 0</xcr:Rotation>\n<xcr:Position>1 2 3</xcr:Position>\n"
         "<xcr:DistortionCoeficients>" +
         lens + "</xcr:DistortionCoeficients>\n</rdf:Description>\n</rdf:RDF>\n</x:xmpmeta>\n";
}

TEST(RealityCapture, LengthsInTheImageAreFractionsOfItsLongerSide) {
  const Calibration found = read_text(make_realitycapture_calibration, xmp(), "IMG_7.xmp");
  EXPECT_EQ(found.unit, "m");
  EXPECT_EQ(found.up, "+z");
  ASSERT_EQ(found.cameras.size(), 1u);
  EXPECT_EQ(found.cameras[0].name, "IMG_7");
  EXPECT_EQ(found.cameras[0].width, 0);
  EXPECT_TRUE(has_relative_intrinsics(found.cameras[0]));
  EXPECT_THAT(found.notes, Contains(HasSubstr("longer side")));
  const Camera wide = with_image_size(found.cameras[0], 4000, 3000),
               tall = with_image_size(found.cameras[0], 3000, 4000);
  Eigen::Matrix3d K;
  K << 3000, 0, 2040, 0, 3000, 1420, 0, 0, 1;
  EXPECT_LT((wide.K - K).norm(), 1e-9);
  K << 3000, 0, 1540, 0, 3000, 1920, 0, 0, 1;
  EXPECT_LT((tall.K - K).norm(), 1e-9);
  EXPECT_EQ(tall.height, 4000);
  // 0.4 to the right and 0.5 up at depth 2
  const Eigen::Vector2d pixel = without_distortion(wide).project({1.4, 4.0, 3.5});
  EXPECT_NEAR(pixel.x(), 2040 + 3000 * 0.2, 1e-9);
  EXPECT_NEAR(pixel.y(), 1420 - 3000 * 0.25, 1e-9);
}

TEST(RealityCapture, TheCoefficientsAreRadialThenTangential) {
  const Calibration found = read_text(make_realitycapture_calibration, xmp());
  EXPECT_EQ(found.cameras[0].lens, Lens::opencv);
  EXPECT_THAT(std::vector<double>(found.cameras[0].distortion.begin(), found.cameras[0].distortion.begin() + 5),
              ::testing::ElementsAre(-0.1, 0.02, 0.002, 0.001, 0.003));
  EXPECT_THAT(found.notes, Contains(HasSubstr("t1 and t2")));
  const Camera four = read_text(make_realitycapture_calibration, xmp("brown4", "-0.1 0.02 0.003 0.5 0 0")).cameras[0];
  EXPECT_EQ(four.lens, Lens::polynomial);
  EXPECT_EQ(four.distortion[5], 0.5);
  EXPECT_FALSE(read_text(make_realitycapture_calibration, xmp("division", "0 0 0 0 0 0")).cameras[0].has_distortion());
  EXPECT_THAT(refusal(make_realitycapture_calibration, xmp("division", "-0.1 0 0 0 0 0")),
              HasSubstr("xcr:DistortionModel is \"division\""));
}

TEST(RealityCapture, ValuesMayBeAttributesOrElements) {
  std::string text =
      replaced(xmp(), "<xcr:Position>1 2 3</xcr:Position>", "<xcr:FocalLength35mm>54</xcr:FocalLength35mm>");
  text = replaced(text, "xcr:FocalLength35mm=\"27\"", "xcr:Position=\"4 5 6\"");
  const Camera camera = read_text(make_realitycapture_calibration, text).cameras[0];
  EXPECT_EQ(camera.K(0, 0), 1.5);
  EXPECT_LT((camera.centre() - Eigen::Vector3d(4, 5, 6)).norm(), 1e-12);
}

TEST(RealityCapture, AFolderIsReadByNameAndCountsWhatItLeavesOut) {
  const TemporaryFolder folder;
  support::write_bytes(folder / "b.xmp", xmp());
  support::write_bytes(folder / "a.XMP", xmp());
  support::write_bytes(folder / "d.xmp", "<x:xmpmeta><rdf:RDF/></x:xmpmeta>");
  support::write_bytes(folder / "notes.txt", "nothing");
  support::write_bytes(folder / "c.xmp", replaced(xmp(), "<xcr:Position>1 2 3</xcr:Position>", ""));
  EXPECT_TRUE(make_realitycapture_calibration()->recognises(source_of(folder.path())));
  const Calibration found = read(make_realitycapture_calibration, folder.path());
  ASSERT_EQ(found.cameras.size(), 2u);
  EXPECT_EQ(found.cameras[0].name, "a");
  EXPECT_TRUE(found.has_poses);
  EXPECT_THAT(found.notes, Contains(HasSubstr("1 cameras without a pose")));
  EXPECT_THAT(found.notes, Contains(HasSubstr("1 XMP files of other programs")));
  EXPECT_FALSE(read(make_realitycapture_calibration, folder / "c.xmp").has_poses);
  const TemporaryFolder empty;
  EXPECT_FALSE(make_realitycapture_calibration()->recognises(source_of(empty.path())));
  EXPECT_FALSE(make_realitycapture_calibration()->recognises({empty / "missing", "", true}));
}

TEST(RealityCapture, TablesHaveTwoKindsOfAngles) {
  // A camera that looks north (+y) with z up, by both kinds of angles; the heading turns clockwise.
  const Calibration heading = read_text(
      make_realitycapture_calibration,
      "#cameras 2\n#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n"
      "north.jpg,1,2,3,0,90,0,27,0.01,-0.02,-0.1,0.02,0.003,0,0,0\neast.jpg,1,2,3,90,90,0,27,0,0,0,0,0,0,0,0\n");
  ASSERT_EQ(heading.cameras.size(), 2u);
  EXPECT_EQ(heading.cameras[0].name, "north.jpg");
  EXPECT_LT((heading.cameras[0].centre() - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  Eigen::Matrix3d R;
  R << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  EXPECT_LT((heading.cameras[0].R - R).norm(), 1e-12);
  EXPECT_EQ(heading.cameras[0].K, read_text(make_realitycapture_calibration, xmp()).cameras[0].K);
  EXPECT_EQ(heading.cameras[0].distortion[4], 0.003);
  EXPECT_LT((heading.cameras[1].R.row(2).transpose() - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
  // All angles 0: the camera looks down with +y at the upper edge. phi lifts the view, at 90 degrees to the north.
  const Calibration omega = read_text(make_realitycapture_calibration,
                                      "#name,x,y,z,omega,phi,kappa,f\r\na,1,2,3,0,0,0,27\r\nb,1,2,3,0,90,0,27\r\n");
  EXPECT_LT((omega.cameras[0].R - kFlip).norm(), 1e-12);
  EXPECT_LT((omega.cameras[1].R - R).norm(), 1e-12);
}

TEST(RealityCapture, ATableWithoutIntrinsicsSaysWhatIsMissing) {
  EXPECT_THAT(refusal(make_realitycapture_calibration, "#cameras 1\n#name,x,y,z,omega,phi,kappa\na,1,2,3,4,5,6\n"),
              ::testing::AllOf(HasSubstr("file.txt:2: "), HasSubstr("intrinsics are missing (the column f"),
                               HasSubstr("Internal/External camera parameters")));
  EXPECT_THAT(refusal(make_realitycapture_calibration, "name,x,y,z\na,1,2,3\n"), HasSubstr("omega"));
  const std::string table = "#name,x,y,z,omega,phi,kappa,f\na,1,2,3,4,5,6,27\nb,1,2,3,4,5,6,27\n";
  EXPECT_THAT(refusal(make_realitycapture_calibration, replaced(table, "6,27\nb", "x,27\nb")), HasSubstr("kappa"));
  expect_hostile(make_realitycapture_calibration, table);
  expect_hostile(make_realitycapture_calibration, xmp());
  EXPECT_THAT(refusal(make_realitycapture_calibration, replaced(xmp(), "FocalLength35mm", "Other")),
              HasSubstr("xcr:FocalLength35mm is missing"));
  EXPECT_THAT(refusal(make_realitycapture_calibration, replaced(xmp(), "xcr:Skew=\"0\"", "xcr:Skew=\"1\"")),
              HasSubstr("xcr:Skew is 1"));
}

// ----------------------------------------------------------------------------------------------------------- Captury

// Stands at (1, 2, 3) m and looks along -z with y up.
constexpr const char* kCaptury =
    "tc camera calibration v0.3\n"
    "camera\t0\tAA:01\n"
    "\tserialNumber\t77\t# a comment\n"
    "\torientation\t6\n"
    "\tframe\t0\n"
    "\t\tsensorSize\t4.8\t3.0\t# mm\n"
    "\t\tfocalLength\t6\n"
    "\t\tpixelAspect\t1.01\n"
    "\t\tcenterOffset\t0.024\t-0.048\n"
    "\t\tdistortionModel\tOpenCV\n"
    "\t\tdistortion\t-0.1\t0.02\t0.001\t-0.002\t0.003\t# k\n"
    "\t\torigin\t1000\t2000\t3000\n"
    "\t\tup\t0\t1\t0\n"
    "\t\tright\t1\t0\t0\n"
    "\tcolorCorrection\t3\n"
    "\t\t0.1 0.2 0.3\n"
    "camera\t1\n"
    "\tserialNumber\t78\n"
    "\tframe\t0\n"
    "\t\tsensorSize\t4.8\t3.0\n"
    "\t\tfocalLength\t6\n"
    "\t\tpixelAspect\t1\n"
    "\t\tcenterOffset\t0\t0\n"
    "\t\tdistortionModel\tOpenCV\n"
    "\t\tdistortion\t0\t0\t0\t0\t0\n"
    "\t\torigin\t0\t0\t0\n"
    "\t\tup\t0\t0\t-1\n"
    "\t\tright\t1\t0\t0\n";

TEST(Captury, TheWidthOfTheSensorCountsForBothAxes) {
  const Calibration found = read_text(make_captury_calibration, kCaptury);
  EXPECT_EQ(found.unit, "mm");
  EXPECT_EQ(found.up, "+y");
  ASSERT_EQ(found.cameras.size(), 2u);
  EXPECT_EQ(found.cameras[0].name, "AA:01");
  EXPECT_EQ(found.cameras[1].name, "78");
  EXPECT_EQ(found.cameras[0].width, 0);
  EXPECT_TRUE(has_relative_intrinsics(found.cameras[0]));
  EXPECT_THAT(found.notes, Contains(HasSubstr("size of the images")));
  const Camera camera = with_image_size(found.cameras[0], 1600, 900);
  EXPECT_NEAR(camera.K(0, 0), 1600 * 6 / 4.8, 1e-9);
  EXPECT_NEAR(camera.K(1, 1), 1600 * 6 * 1.01 / 4.8, 1e-9);
  EXPECT_NEAR(camera.K(0, 2), 1600 * (0.5 + 0.024 / 4.8), 1e-9);
  EXPECT_NEAR(camera.K(1, 2), 1600 * (1.5 - 0.048) / 4.8, 1e-9);
  EXPECT_EQ(camera.height, 900);
  EXPECT_THAT(std::vector<double>(camera.distortion.begin(), camera.distortion.begin() + 5),
              ::testing::ElementsAre(-0.1, 0.02, 0.001, -0.002, 0.003));
  // 0.4 to the right and 0.6 up at depth 2: 0.2 and 0.3 focal lengths of 2000 and 2020 pixels from (808, 484).
  const Eigen::Vector2d pixel = without_distortion(camera).project({1.4, 2.6, 1.0});
  EXPECT_NEAR(pixel.x(), 808.0 + 0.2 * 2000.0, 1e-9);
  EXPECT_NEAR(pixel.y(), 484.0 - 0.3 * 2020.0, 1e-9);
  // Neither the height of the images nor that of the sensor changes a focal length; the latter moves the centre.
  EXPECT_NEAR(with_image_size(found.cameras[0], 1600, 1200).K(1, 1), 2020.0, 1e-9);
  const Calibration high = read_text(make_captury_calibration, replaced(kCaptury, "4.8\t3.0\t#", "4.8\t3.6\t#"));
  EXPECT_NEAR(with_image_size(high.cameras[0], 1600, 900).K(1, 1), 2020.0, 1e-9);
  EXPECT_NEAR(with_image_size(high.cameras[0], 1600, 900).K(1, 2), 484.0 + 100.0, 1e-9);
  // Its width changes both.
  const Calibration wide = read_text(make_captury_calibration, replaced(kCaptury, "4.8\t3.0\t#", "9.6\t3.0\t#"));
  EXPECT_NEAR(with_image_size(wide.cameras[0], 1600, 900).K(0, 0), 1000.0, 1e-9);
  EXPECT_NEAR(with_image_size(wide.cameras[0], 1600, 900).K(1, 1), 1010.0, 1e-9);
  // The second camera looks along -y, with up along -z: 0.5 to the right and 0.25 towards -z at depth 1.
  const Camera second = with_image_size(found.cameras[1], 800, 500);
  const Eigen::Vector2d other = without_distortion(second).project({0.5, -1.0, -0.25});
  EXPECT_NEAR(other.x(), 400.0 + 0.5 * 1000.0, 1e-9);
  EXPECT_NEAR(other.y(), 250.0 - 0.25 * 1000.0, 1e-9);
}

TEST(Captury, OtherLensesMovingCamerasAndMissingKeysAreRefused) {
  const auto message = [](const char* from, const char* to) {
    return refusal(make_captury_calibration, replaced(kCaptury, from, to));
  };
  EXPECT_THAT(message("OpenCV", "Division"), HasSubstr("camera AA:01 has the distortionModel \"Division\""));
  EXPECT_THAT(message("\t\tup\t0\t1\t0\n", "\tframe\t1\n"), HasSubstr("camera AA:01 moves"));
  EXPECT_THAT(message("\t\tup\t0\t1\t0\n", ""),
              HasSubstr("file.txt:2: reading a camera calibration: camera AA:01 has no \"up\""));
  EXPECT_THAT(message("sensorSize\t4.8", "sensorSize\t0"), HasSubstr("sensorSize"));
  EXPECT_THAT(message("focalLength\t6", "focalLength\t#"), HasSubstr("focalLength"));
  EXPECT_THAT(message("0.003\t#", "0.003\t1\t2\t#"), HasSubstr("7 coefficients"));
  EXPECT_THAT(read_text(make_captury_calibration, replaced(kCaptury, "v0.3", "v0.4")).notes,
              Contains(HasSubstr("v0.4")));
  EXPECT_THAT(refusal(make_captury_calibration, "tc camera calibration v0.3\n"), HasSubstr("no \"camera\""));
  expect_hostile(make_captury_calibration, kCaptury);
}

// ---------------------------------------------------------------------------------------------------------- all kinds

std::vector<std::string> all_files() {
  return {qualisys_valid(),
          vicon_rig(false),
          optitrack_valid(),
          metashape_file(metashape_camera(0, "a", kMetashapePose)),
          xmp(),
          kCaptury};
}

TEST(XmlCalibrations, EachFileIsRecognisedByItsOwnFormatOnly) {
  const std::vector<std::string> files = all_files();
  for (std::size_t f = 0; f < files.size(); ++f)
    for (std::size_t m = 0; m < files.size(); ++m)
      EXPECT_EQ(kMakers[m]()->recognises({"any.xml", files[f], false}), f == m) << f << " by " << kMakers[m]()->name();
  EXPECT_TRUE(make_realitycapture_calibration()->recognises(
      {"a.csv", "#cameras 7\r\n#name, x,y,alt,yaw,pitch,roll,f\r\n", false}));
}

TEST(XmlCalibrations, FilesOfOthersAreNotRecognised) {
  const char* const others[] = {
      "",
      "<",
      "<?xml version=\"1.0\"?>\n<opencv_storage><Cameras><Camera DEVICEID=\"1\"/></Cameras></opencv_storage>",
      "<calibration><projection>frame</projection><width>7</width></calibration>",
      "<Cameras/>",
      "<document><text/></document>",
      "<x:xmpmeta><rdf:RDF/></x:xmpmeta>",
      "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\na,1,1,0,0,0,0,0,0,1,1,0.5,0.5\n",
      "sync_index,cam_id,img_loc_x\n1,2,3\n",
      "{\"cameras\": []}",
      "%YAML:1.0\n---\nK1: 3\n",
      "Skeletool Camera Calibration File V1.0\n",
      "#cameras 7",
  };
  for (const char* other : others)
    for (const Maker make : kMakers) EXPECT_FALSE(make()->recognises({"any", other, false})) << other;
}

TEST(XmlCalibrations, RecognisingNeverThrows) {
  for (const std::string& file : all_files())
    for (std::size_t n = 0; n < std::min<std::size_t>(file.size(), 400); ++n)
      for (const Maker make : kMakers) EXPECT_NO_THROW((void)make()->recognises({"any", file.substr(0, n), false}));
}

TEST(XmlCalibrations, XmlFaultsNameTheLine) {
  EXPECT_THAT(refusal(make_vicon_calibration, "<Cameras>\n<Camera>\n</Other>\n</Cameras>\n"),
              HasSubstr("file.txt:3: reading a camera calibration: this is no valid XML"));
  EXPECT_THAT(refusal(make_vicon_calibration, "<Cameras/>\n<Cameras/>\n"), HasSubstr("2 root elements"));
  EXPECT_THAT(refusal(make_vicon_calibration, std::string("<Cameras>\0</Cameras>", 20)), HasSubstr("NUL"));
}

TEST(RootElement, IsTheFirstElementBehindCommentsAndDeclarations) {
  EXPECT_EQ(root_element("\xEF\xBB\xBF<?xml version=\"1.0\"?>\n<!-- <a> -->\r\n<!DOCTYPE x><name key=\"1\">"), "name");
  EXPECT_EQ(root_element("<name/>"), "name");
  EXPECT_EQ(root_element("<!-- unfinished"), "");
  EXPECT_EQ(root_element("text <name>"), "");
}

// -------------------------------------------------------------------------------------------------------- shared parts

TEST(InverseLens, UndoesTheOtherDirection) {
  Camera camera;
  camera.width = 1600;
  camera.height = 1200;
  camera.K << 1500, 0, 810, 0, 1490, 590, 0, 0, 1;
  const auto straight = [](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return p * (1.0 - 0.12 * p.squaredNorm() + 0.05 * std::pow(p.squaredNorm(), 2));
  };
  const auto lens = fit_inverse_lens(straight, camera);
  ASSERT_TRUE(lens);
  EXPECT_LT(lens->largest_residual_px, 0.01);
  for (std::size_t i = 8; i < 12; ++i) EXPECT_EQ(lens->coefficients[i], 0.0);
  std::copy(lens->coefficients.begin(), lens->coefficients.end(), camera.distortion.begin());
  EXPECT_LT((camera.distorted(straight({0.4, -0.3})) - Eigen::Vector2d(0.4, -0.3)).norm() * 1500, 0.01);
  const auto folds = [](const Eigen::Vector2d& p) -> Eigen::Vector2d { return p * (1.0 - 2.0 * p.squaredNorm()); };
  EXPECT_FALSE(fit_inverse_lens(folds, camera));
  const auto broken = [](const Eigen::Vector2d& p) -> Eigen::Vector2d { return p / 0.0; };
  EXPECT_FALSE(fit_inverse_lens(broken, camera));
}

TEST(CommonView, IsWhereTheCamerasLook) {
  const std::vector<PinholeCamera> ring = ring_of_cameras(5, 100, {0.3, 1.0, -2.0});
  std::vector<Camera> cameras(ring.begin(), ring.end());
  const auto view = common_view(cameras);
  ASSERT_TRUE(view);
  EXPECT_LT((view->point - Eigen::Vector3d(0.3, 1.0, -2.0)).norm(), 1e-9);
  EXPECT_NEAR(view->median_depth, 3.0 * std::sqrt(1.01), 1e-9);
  EXPECT_EQ(view->behind, 0);
  EXPECT_TRUE(look_at_one_point(cameras));
  for (Camera& camera : cameras) {  // turned away, at the same positions
    const Eigen::Vector3d centre = camera.centre();
    camera.R = kFlip * camera.R;
    camera.t = -camera.R * centre;
  }
  EXPECT_FALSE(look_at_one_point(cameras));
  EXPECT_FALSE(common_view({cameras[0]}));
  EXPECT_FALSE(common_view({cameras[0], cameras[0]}));
  cameras[1].t.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(common_view(cameras));
}

TEST(RelativeIntrinsics, PixelsAndStatedSizesStay) {
  Camera camera;
  camera.K << 1000, 0, 500, 0, 1000, 400, 0, 0, 1;
  EXPECT_FALSE(has_relative_intrinsics(camera));
  EXPECT_EQ(with_image_size(camera, 640, 480).K, camera.K);
  EXPECT_EQ(with_image_size(camera, 640, 480).width, 640);
  camera.width = camera.height = 7;
  EXPECT_EQ(with_image_size(camera, 640, 480).width, 7);
}

}  // namespace
}  // namespace doppel::xml_calibrations_test
