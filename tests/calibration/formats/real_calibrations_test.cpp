#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/calibration/formats/relative_intrinsics.h"
#include "support/shared_folder.h"

namespace doppel::real_calibrations_test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

class RealCalibrationFiles : public support::SharedFolderTest {};

TEST_F(RealCalibrationFiles, BothCalibrationFilesAgree) {
  const std::vector<Camera> a = read_calibration(capture_folder() / "calibration/cameras.calibration");
  const std::vector<Camera> b = read_calibration(capture_folder() / "calibration/cameras.yml");
  ASSERT_EQ(a.size(), 8u);
  ASSERT_EQ(b.size(), 8u);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].name, std::to_string(i));
    EXPECT_EQ(a[i].name, b[i].name);
    EXPECT_EQ(a[i].width, b[i].width);
    // The Skeletool file has 9 digits.
    EXPECT_LT((a[i].K - b[i].K).norm(), 1e-5);
    EXPECT_LT((a[i].R - b[i].R).norm(), 1e-7);
    EXPECT_LT((a[i].t - b[i].t).norm(), 1e-6);
    EXPECT_LT((a[i].project({0, 1, 0}) - b[i].project({0, 1, 0})).norm(), 1e-4);
    EXPECT_GT(a[i].camera_from_world({0, 1, 0}).z(), 1) << "camera " << i << " looks away from the scene";
  }
}

struct Sample {
  const char* file;          ///< below shared/formats
  const char* ground_truth;  ///< beside it, or one folder above
  const char* format;        ///< expected name
};

const Sample kSamples[] = {
    {"actorshq_csv/made/calibration.csv", "truth.json", "actorshq"},
    {"aist_setting_json/setting1/setting1.json", "truth.json", "aist"},
    {"aniposelib_toml/sleap_anipose/calibration.toml", "truth.json", "toml"},
    {"caliscope_toml/4_cam_recording/camera_array.toml", "truth.json", "caliscope"},
    {"caliscope_toml/post_optimization/camera_array.toml", "truth.json", "caliscope"},
    {"captury_calib/made/cameras.calib", "truth.json", "captury"},
    {"colmap/made_six_models/bin", "../truth.json", "colmap"},
    {"colmap/made_six_models/txt", "../truth.json", "colmap"},
    {"colmap/opencv_two_cameras/bin/cameras.bin", "../truth.json", "colmap"},
    {"colmap/opencv_two_cameras/txt/images.txt", "../truth.json", "colmap"},
    {"colmap/simple_radial_txt_bin/bin", "../truth_bin.json", "colmap"},
    {"colmap/simple_radial_txt_bin/txt", "../truth_txt.json", "colmap"},
    {"easymocap_yml/trackmesh/intri.yml", "truth.json", "easymocap"},
    {"easymocap_yml/trackmesh/extri.yml", "truth.json", "easymocap"},
    {"freemocap_toml/test_data/freemocap_test_data_camera_calibration.toml", "truth.json", "toml"},
    {"gaussian_splatting_cameras_json/trackmesh/cameras.json", "truth.json", "gaussian_splatting"},
    {"kalibr_camchain/t265_with_T_cn_cnm1/kalibr_imucam_chain.yaml", "truth.json", "kalibr"},
    {"kalibr_camchain/tum_vi_equidistant/kalibr_imucam_chain.yaml", "truth.json", "kalibr"},
    {"metashape_xml/road/road.xml", "truth.json", "metashape"},
    {"opencap_pickle/iPhone16_1/cameraIntrinsics.pickle", "truth.json", "opencap"},
    {"opencv_filestorage/stereo_calib/intrinsics.yml", "truth.json", "opencv_stereo"},
    {"optitrack_mcal/made/made.mcal", "truth.json", "optitrack"},
    {"panoptic/160906_band1/calibration_160906_band1.json", "truth.json", "panoptic"},
    {"pose2sim_toml/demo/Calib_qualisys.toml", "truth.json", "toml"},
    {"qualisys_qca/demo/Calib.qca.txt", "truth.json", "qualisys"},
    {"realitycapture/IMG_8834/IMG_8834.xmp", "truth.json", "realitycapture"},
    {"ros_camera_info/image_common/test_calibration.yaml", "truth.json", "ros_camera_info"},
    {"shelf_campus_json/shelf/calibration_shelf.json", "truth.json", "shelf"},
    {"transforms_json/multicam_per_frame_intrinsics/transforms.json", "truth.json", "nerfstudio"},
    {"vicon_xcp/made/made.xcp", "truth.json", "vicon"},
    {"zju_annots_npy/made/annots.npy", "truth.json", "zju"},
};

Json read_ground_truth(const fs::path& formats, const Sample& sample) {
  const fs::path file = formats / sample.file;
  const fs::path folder = fs::is_directory(file) ? file : file.parent_path();
  const std::string ground_truth = sample.ground_truth;
  // "../" is relative to the folder of the sample.
  std::ifstream stream((folder / ground_truth).lexically_normal());
  return Json::parse(stream);
}

Eigen::Vector3d vector_of(const Json& list) {
  return {list[0].get<double>(), list[1].get<double>(), list[2].get<double>()};
}

class RealCalibrations : public support::SharedFolderTest, public ::testing::WithParamInterface<Sample> {};

/// The pixel of the ground truth in the convention of the program. Where the format leaves the convention open, both
/// are right.
double pixel_distance(const Eigen::Vector2d& found, const Json& expected, const std::string& convention) {
  const Eigen::Vector2d pixel(expected[0].get<double>(), expected[1].get<double>());
  const double as_integer = (found - pixel - Eigen::Vector2d(0.5, 0.5)).norm(), as_half = (found - pixel).norm();
  if (convention.starts_with("half")) return as_half;
  if (convention.starts_with("unknown")) return std::min(as_half, as_integer);
  return as_integer;
}

/// The camera as the ground truth has it: with its size, and for OptiTrack without the lens, which the ground truth
/// leaves out.
Camera comparable(Camera camera, const Json& expected, const std::string& format) {
  if (!expected["width"].is_null())
    camera = with_image_size(camera, expected["width"].get<int>(), expected["height"].get<int>());
  return format == "optitrack" ? without_distortion(camera) : camera;
}

/// All cameras, or only those with a pose if there are any (a file of intrinsics may list more cameras).
std::vector<Json> usable_cameras(const Json& ground_truth) {
  const auto has_pose = [](const Json& camera) { return camera.contains("centre_m") && !camera["centre_m"].is_null(); };
  const Json& all = ground_truth["cameras"];
  if (std::none_of(all.begin(), all.end(), has_pose)) return {all.begin(), all.end()};
  std::vector<Json> cameras;
  std::copy_if(all.begin(), all.end(), std::back_inserter(cameras), has_pose);
  return cameras;
}

/// The camera of a name. A name in the ground truth may also be the path of an image, of which the reader takes the
/// stem or the folder; names that are not found stand at the same position in the file.
const Json& camera_named(const std::vector<Json>& cameras, const std::string& name, std::size_t index) {
  for (const Json& camera : cameras) {
    const fs::path path = camera["name"].get<std::string>();
    if (path == name || path.stem() == name || fs::path(path).replace_extension() == name) return camera;
  }
  return cameras.at(index);
}

/// Metashape's sample has coordinates of a map; the reader moves the origin near the cameras.
Eigen::Vector3d origin_shift(const Calibration& found, const Json& ground_truth) {
  if (found.format != "metashape") return Eigen::Vector3d::Zero();
  const Eigen::Vector3d expected = vector_of(ground_truth["cameras"][0]["centre_m"]);
  const Eigen::Vector3d shift = expected - found.cameras[0].centre();
  return shift.array().round();
}

TEST_P(RealCalibrations, IsReadByContentAndAgreesWithTheGroundTruth) {
  const Sample& sample = GetParam();
  const Json ground_truth = read_ground_truth(shared_ / "formats", sample);
  CalibrationOptions options;
  options.up = "+y";  // keeps the axes of the file
  const Calibration found = load_calibration(shared_ / "formats" / sample.file, options);
  EXPECT_EQ(found.format, sample.format);
  const std::vector<Json> expected_cameras = usable_cameras(ground_truth);
  ASSERT_EQ(found.cameras.size(), expected_cameras.size());
  const Eigen::Vector3d shift = origin_shift(found, ground_truth);
  for (std::size_t index = 0; index < found.cameras.size(); ++index) {
    const Json& expected = camera_named(expected_cameras, found.cameras[index].name, index);
    const Camera camera = comparable(found.cameras[index], expected, found.format);
    SCOPED_TRACE(camera.name);
    if (!expected["width"].is_null()) {
      EXPECT_EQ(camera.width, expected["width"].get<int>());
    }
    EXPECT_NEAR(camera.K(0, 0), expected["fx"].get<double>(), 1e-6);
    EXPECT_EQ(found.has_poses, expected.contains("centre_m"));
    if (!found.has_poses) continue;
    EXPECT_LT((camera.centre() + shift - vector_of(expected["centre_m"])).norm(), 1e-6);
    for (std::size_t p = 0; p < expected["projections"].size(); ++p) {
      const Json& projection = expected["projections"][p];
      if (!projection.contains("pixel") || projection["pixel"].is_null()) continue;
      const Eigen::Vector2d pixel = camera.project(vector_of(ground_truth["points_world_m"][p]) - shift);
      // Far outside of the image the polynomial of a lens enlarges rounding errors.
      const double scale = std::max(1.0, pixel.norm() / 1e4);
      EXPECT_LT(pixel_distance(pixel, projection["pixel"], ground_truth["pixel_centre"].get<std::string>()),
                1e-3 * scale);
    }
  }
}

std::string sample_name(const ::testing::TestParamInfo<Sample>& sample) {
  std::string name = sample.param.file;
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
}
INSTANTIATE_TEST_SUITE_P(Real, RealCalibrations, ::testing::ValuesIn(kSamples), sample_name);

/// Small files that stand for faults which users of other programs reported.
class RealCalibrationCases : public support::SharedFolderTest {
 protected:
  void SetUp() override {
    SharedFolderTest::SetUp();
    if (!IsSkipped() && !fs::exists(shared_ / "cases"))
      GTEST_SKIP() << shared_ / "cases"
                   << " is missing";
  }
  fs::path file(const char* name) const { return shared_ / "cases" / name; }
};

TEST_F(RealCalibrationCases, ARigOfMetashapeHasTheCamerasOfItsReference) {
  const std::vector<Camera> rig = read_calibration(file("11-metashape-camera-rig/cameras_rig.xml")),
                            right = read_calibration(file("11-metashape-camera-rig/reference_all_absolute.xml"));
  ASSERT_EQ(rig.size(), 4u);
  ASSERT_EQ(right.size(), 4u);
  for (std::size_t i = 0; i < rig.size(); ++i) {
    EXPECT_EQ(rig[i].name, right[i].name);
    EXPECT_LT((rig[i].R - right[i].R).norm(), 1e-9);
    EXPECT_LT((rig[i].centre() - right[i].centre()).norm(), 1e-9);
  }
}

TEST_F(RealCalibrationCases, TheSubjectIsThatOfTheFolder) {
  const std::vector<Camera> cameras = read_calibration(file("26-human36m-other-subjects/S9/camera-parameters.json"));
  ASSERT_EQ(cameras.size(), 2u);
  // X_cam = R X + t with t of 5.0 m and 5.3 m in the two subjects; the cameras look at each other.
  EXPECT_NEAR((cameras[0].centre() - cameras[1].centre()).norm(), 10.3, 1e-9);
  CalibrationOptions other;
  other.subject = "S1";
  const Calibration first = load_calibration(file("26-human36m-other-subjects/S9/camera-parameters.json"), other);
  EXPECT_NEAR((first.cameras[0].centre() - first.cameras[1].centre()).norm(), 10.0, 1e-9);
}

TEST_F(RealCalibrationCases, AStereoFileHasItsOwnIntrinsics) {
  for (const char* name :
       {"31-opencv-stereo-in-one-file/a/stereo_calib.yml", "31-opencv-stereo-in-one-file/c/stereo_calib.yml"}) {
    const std::vector<Camera> cameras = read_calibration(file(name));
    ASSERT_EQ(cameras.size(), 2u);
    EXPECT_EQ(cameras[0].K(0, 0), 1750);
    EXPECT_EQ(cameras[1].K(0, 0), 1760);
    EXPECT_EQ(cameras[0].width, 1456);
    EXPECT_EQ(cameras[1].height, 1088);
  }
}

TEST_F(RealCalibrationCases, AMessageOfRosIsOneCamera) {
  const Calibration found = load_calibration(file("32-ros-camera-info-message/ros1_echo.yaml"));
  ASSERT_EQ(found.cameras.size(), 1u);
  EXPECT_EQ(found.cameras[0].width, 752);
  EXPECT_EQ(found.cameras[0].height, 480);
  EXPECT_EQ(found.cameras[0].K(0, 0), 458);
  EXPECT_EQ(found.cameras[0].K(1, 1), 457);
}

}  // namespace
}  // namespace doppel::real_calibrations_test
