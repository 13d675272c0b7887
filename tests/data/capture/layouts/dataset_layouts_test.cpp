#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "data/capture/capture_fixture.h"
#include "doppel/core/atomic_file.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/find_capture.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel::dataset_layouts_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr int kSide = 16;

void write_image(const fs::path& path, int value) {
  fs::create_directories(path.parent_path());
  cv::imwrite(path.string(), cv::Mat(kSide, kSide, CV_8UC1, cv::Scalar(value)));
}

void write_clip(const fs::path& path) {
  test_capture::write_video(path, "MJPG", std::vector<cv::Mat>(3, cv::Mat(kSide, kSide, CV_8UC3, cv::Scalar::all(90))));
}

/// Two cameras that look at the middle from both sides.
std::vector<Camera> two_cameras(const std::vector<std::string>& names) {
  std::vector<Camera> cameras;
  for (int i = 0; i < 2; ++i) {
    cameras.push_back(test_capture::ring_camera(i, 2));
    cameras.back().name = names[static_cast<std::size_t>(i)];
    cameras.back().width = cameras.back().height = kSide;
  }
  return cameras;
}

CaptureGuess recognised(const fs::path& folder, const std::string& layout) {
  const auto found = recognise_capture(folder);
  if (!found) throw std::runtime_error("not recognised: " + layout);
  EXPECT_EQ(found->layout, layout);
  EXPECT_THAT(found->found.at(0), HasSubstr("layout of " + layout + " ("));
  // What was recognised can be written and read, and names cameras of the calibration.
  const support::TemporaryFolder out;
  write_capture(out / "capture.yaml", found->capture);
  EXPECT_EQ(choose_cameras(read_capture(out.path())).cameras.size(), 2u) << layout;
  return *found;
}

TEST(DatasetLayouts, EasyMocapAndZju) {
  const support::TemporaryFolder folder;
  write_calibration(folder / "model", two_cameras({"1", "2"}), "easymocap");
  for (const char* name : {"intri.yml", "extri.yml"}) fs::rename(folder / "model" / name, folder / name);
  for (const char* camera : {"1", "2"})
    for (int frame = 0; frame < 3; ++frame) {
      write_image(folder / "images" / camera / fmt::format("{:06}.jpg", frame), 90);
      write_image(folder / "mask" / camera / fmt::format("{:06}.png", frame), 1);
      write_image(folder / "mask_cihp" / camera / fmt::format("{:06}.png", frame), 5);
    }
  const SequenceEntry entry = recognised(folder.path(), "EasyMocap").capture.sequences.at(0);
  EXPECT_EQ(entry.videos, "images/{name}/{frame:06}.jpg");
  EXPECT_EQ(entry.masks, "mask_cihp/{name}/{frame:06}.png");
  EXPECT_EQ(entry.mask_threshold, 1);
}

TEST(DatasetLayouts, ActorsHq) {
  const support::TemporaryFolder folder;
  write_atomically(
      folder / "calibration.csv",
      fmt::format("name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\n"
                  "Cam001,{0},{0},0,0,0,0,1,-3,1.2,1.2,0.5,0.5\nCam002,{0},{0},0,3.1,0,0,1,3,1.2,1.2,0.5,0.5\n",
                  kSide));
  for (const char* camera : {"Cam001", "Cam002"})
    for (int frame = 0; frame < 3; ++frame) {
      write_image(folder / "rgbs" / camera / fmt::format("{}_rgb{:06}.jpg", camera, frame), 90);
      write_image(folder / "masks" / camera / fmt::format("{}_mask{:06}.png", camera, frame), 255);
    }
  const SequenceEntry entry = recognised(folder.path(), "ActorsHQ").capture.sequences.at(0);
  EXPECT_EQ(entry.videos, "rgbs/{name}/{name}_rgb{frame:06}.jpg");
  EXPECT_EQ(entry.masks, "masks/{name}/{name}_mask{frame:06}.png");
}

TEST(DatasetLayouts, Panoptic) {
  const support::TemporaryFolder folder;
  std::string cameras;
  for (const auto& [name, type, z] :
       {std::tuple("01_01", "vga", 300), std::tuple("00_03", "hd", 300), std::tuple("00_17", "hd", -300)})
    cameras += fmt::format(
        "{}{{\"name\":\"{}\",\"type\":\"{}\",\"resolution\":[{},{}],\"K\":[[20,0,8],[0,20,8],[0,0,1]],"
        "\"distCoef\":[0,0,0,0,0],\"R\":[[1,0,0],[0,1,0],[0,0,1]],\"t\":[[0],[100],[{}]]}}",
        cameras.empty() ? "" : ",", name, type, kSide, kSide, z);
  write_atomically(folder / "calibration_160906_band1.json",
                   "{\"calibDataSource\":\"x\",\"cameras\":[" + cameras + "]}");
  for (const char* camera : {"03", "17"}) write_clip(folder / "hdVideos" / fmt::format("hd_00_{}.avi", camera));
  for (int frame = 0; frame < 3; ++frame)
    write_atomically(folder / "hdPose3d_stage1_coco19" / fmt::format("body3DScene_{:08}.json", frame),
                     "{\"version\":0.7,\"bodies\":[]}");
  const CaptureGuess found = recognised(folder.path(), "CMU Panoptic");
  EXPECT_EQ(found.capture.cameras, (std::vector<std::string>{"00_03", "00_17"}));
  EXPECT_EQ(found.capture.sequences.at(0).videos, "hdVideos/hd_{name}.avi");
  EXPECT_TRUE(found.capture.sequences.at(0).keypoints.empty()) << "3D poses are no keypoints";
}

TEST(DatasetLayouts, Human36m) {
  const support::TemporaryFolder folder;
  std::string cameras;
  for (const auto& [name, z] : {std::pair("54138969", 4000), std::pair("55011271", 5000)})
    cameras += fmt::format(
        "{}\"{}\":{{\"R\":[[1,0,0],[0,0,-1],[0,1,0]],\"t\":[[0],[900],[{}]],\"f\":[[1145],[1144]],"
        "\"c\":[[512],[515]],\"k\":[0,0,0],\"p\":[0,0]}}",
        cameras.empty() ? "" : ",", name, z);
  write_atomically(folder / "camera-parameters.json", "{" + cameras + "}");
  for (const char* camera : {"54138969", "55011271"}) {
    for (const char* action : {"Walking", "Walking 1"})
      write_clip(folder / "Videos" / fmt::format("{}.{}.avi", action, camera));
    for (const char* action : {"Walking", "Walking 1"})  // MJPG in the name that the dataset gives its videos
      fs::rename(folder / "Videos" / fmt::format("{}.{}.avi", action, camera),
                 folder / "Videos" / fmt::format("{}.{}.mp4", action, camera));
    write_clip(folder / "Videos" / fmt::format("_ALL.{}.avi", camera));
  }
  const Capture capture = recognised(folder.path(), "Human3.6M").capture;
  ASSERT_EQ(capture.sequences.size(), 2u);
  EXPECT_EQ(capture.sequences[0].videos, "Videos/Walking 1.{name}.mp4");
  EXPECT_EQ(capture.sequences[1].name, "walking");
}

TEST(DatasetLayouts, DeepCapInTheWild) {
  const support::TemporaryFolder folder;
  write_calibration(folder / "monocularCalibration.calibration", {two_cameras({"0", "1"})[0]});
  write_clip(folder / "Antonia/images0.avi");
  write_clip(folder / "Antonia/images1.avi");
  const auto found = recognise_capture(folder / "Antonia");
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->layout, "DeepCap");
  EXPECT_EQ(found->capture.calibration, "../monocularCalibration.calibration");
  ASSERT_EQ(found->capture.sequences.size(), 2u);
  EXPECT_EQ(found->capture.sequences[1].videos, "images1.avi");
}

TEST(DatasetLayouts, UmaNamesItsCalibrationCalib) {
  const support::TemporaryFolder folder;
  std::string text = "tc camera calibration v0.3\n";
  for (int i = 0; i < 2; ++i)
    text += fmt::format(
        "camera\t{0}\tcam{0}\nframe\t0\nsensorSize\t10\t10\nfocalLength\t12\npixelAspect\t1\n"
        "centerOffset\t0\t0\ndistortionModel\tOpenCV\ndistortion\t0\t0\t0\t0\t0\norigin\t{1}\t1000\t3000\n"
        "up\t0\t1\t0\nright\t1\t0\t0\n",
        i, 500 * i);
  write_atomically(folder / "cameras.calib", text);
  write_atomically(folder / "ddc_character/ddc.character", "x");
  for (int i = 0; i < 2; ++i) {
    write_clip(folder / fmt::format("training/stream{:03}.avi", i));
    write_clip(folder / fmt::format("training/foregroundSegmentation/stream{:03}.avi", i));
  }
  const CaptureGuess found = recognised(folder.path(), "ASH/TriHuman");
  EXPECT_EQ(found.capture.calibration, "cameras.calib");
  EXPECT_EQ(found.capture.sequences.at(0).videos, "training/stream{camera:03}.avi");
}

TEST(DatasetLayouts, AFolderOfVideosIsNoDataset) {
  const support::TemporaryFolder folder;
  write_calibration(folder / "cameras.yml", two_cameras({"a", "b"}));
  for (const char* camera : {"a", "b"}) write_clip(folder / fmt::format("{}.avi", camera));
  EXPECT_FALSE(recognise_capture(folder.path()).has_value());
}

TEST(DatasetLayouts, SignsWithoutFootageAreNoDataset) {
  const support::TemporaryFolder folder;
  write_atomically(folder / "calibration.csv", "broken");
  write_atomically(folder / "rgbs/x.txt", "x");
  EXPECT_FALSE(recognise_capture(folder.path()).has_value());
  const CaptureGuess guess = guess_folder(folder.path());
  EXPECT_FALSE(guess.complete);
  EXPECT_THAT(guess.found.at(0), HasSubstr("looks like ActorsHQ (calibration.csv, rgbs/x.txt), but"));
}

class RealDatasetLayouts : public support::SharedFolderTest {};

// annots.npy has no writer here; the shared folder has a file of its layout.
TEST_F(RealDatasetLayouts, Zju) {
  const support::TemporaryFolder folder;
  fs::create_symlink(shared_ / "formats/zju_annots_npy/made/annots.npy", folder / "annots.npy");
  const std::vector<Camera> cameras = read_posed_cameras(folder / "annots.npy");
  for (const Camera& camera : cameras)
    for (int frame = 0; frame < 2; ++frame) {
      write_image(folder / camera.name / fmt::format("{:06}.jpg", frame), 90);
      write_image(folder / "mask_cihp" / camera.name / fmt::format("{:06}.png", frame), 5);
    }
  const auto found = recognise_capture(folder.path());
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->layout, "ZJU-MoCap");
  EXPECT_EQ(found->capture.sequences.at(0).videos, "{name}/{frame:06}.jpg");
  EXPECT_EQ(found->capture.sequences.at(0).masks, "mask_cihp/{name}/{frame:06}.png");
  EXPECT_EQ(found->capture.sequences.at(0).mask_threshold, 1);
}

}  // namespace
}  // namespace doppel::dataset_layouts_test
