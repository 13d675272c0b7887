#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/data/capture/find_capture.h"
#include "doppel/data/capture/video.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/dataset.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/data/prepare/prepare.h"
#include "doppel/detect/masks/background_model.h"
#include "doppel/detect/masks/components.h"
#include "doppel/detect/masks/mask.h"
#include "support/hostile_files.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel::real_capture_test {
namespace {

namespace fs = std::filesystem;

class RealData : public support::SharedFolderTest {};

TEST_F(RealData, RecognisesAndPreparesTheCapture) {
  const support::TemporaryFolder folder;
  Capture capture = find_capture(capture_folder());
  ASSERT_EQ(capture.sequences.size(), 2u);
  EXPECT_EQ(capture.sequences[0].cuts, (std::vector<long>{80}));
  EXPECT_EQ(capture.character, "character/ddc.character");
  capture.cameras = {"1", "6"};
  PrepareOptions options;
  options.out = folder / "prepared";
  options.limit_frames = 12;
  options.threads = 2;
  const PrepareReport report = prepare_capture(capture, options);
  ASSERT_EQ(report.cameras.size(), 4u);
  for (const CameraReport& camera : report.cameras) {
    EXPECT_GT(camera.template_iou, 0.85) << camera.sequence << " " << camera.camera;
    EXPECT_EQ(camera.border_touch, 0.0);
    EXPECT_EQ(camera.empty_frames, 0);
  }
  const Dataset dataset = Dataset::open(options.out);
  EXPECT_EQ(dataset.keypoints({0, 3}, 1).size(), 25u);
}

// The studio is green and its empty images are given: both ways of keying must come near the true masks.
TEST_F(RealData, ChromaKeyComesNearTheTrueMasks) {
  const auto videos = open_frames((capture_folder() / "training/videos/stream003.mp4").string(), PixelFormat::colour);
  const auto masks =
      open_frames((capture_folder() / "training/foregroundSegmentation/stream003.mkv").string(), PixelFormat::grey);
  const cv::Mat background = cv::imread((capture_folder() / "background/003.png").string());
  for (const long frame : {0L, 40L}) {
    const cv::Mat image = videos->read(frame), ground_truth = threshold_mask(masks->read(frame), 128);
    for (const auto space : {ChromaKey::Space::hsv, ChromaKey::Space::ycrcb}) {
      ChromaKey key;
      key.space = space;
      key.against_background = true;
      const cv::Mat mask = largest_component(chroma_key_mask(image, key, background));
      const double iou =
          static_cast<double>(cv::countNonZero(mask & ground_truth)) / cv::countNonZero(mask | ground_truth);
      EXPECT_GT(iou, 0.9) << static_cast<int>(space) << " " << frame;
    }
  }
}

double iou(const cv::Mat& a, const cv::Mat& b) {
  return static_cast<double>(cv::countNonZero(a & b)) / cv::countNonZero(a | b);
}

// One empty image per camera, and a floor that throws green light back at him.
TEST_F(RealData, SubtractionInTheStudioComesNearTheTrueMasks) {
  double sum = 0.0;
  int count = 0;
  for (const std::string camera : {"000", "003", "006"}) {
    BackgroundModel model;
    model.learn(cv::imread((capture_folder() / "background" / (camera + ".png")).string()));
    const fs::path folder = capture_folder() / "training";
    const auto videos = open_frames((folder / ("videos/stream" + camera + ".mp4")).string(), PixelFormat::colour);
    const auto masks =
        open_frames((folder / ("foregroundSegmentation/stream" + camera + ".mkv")).string(), PixelFormat::grey);
    for (const long frame : {0L, 60L, 120L}) {
      sum += iou(model.mask(videos->read(frame)), threshold_mask(masks->read(frame), 128));
      ++count;
    }
  }
  RecordProperty("mean_iou", std::to_string(sum / count));
  EXPECT_GT(sum / count, 0.92);
}

/// What a camera of the cases filmed, in the first frame.
class RealFootage : public support::SharedFolderTest {
 protected:
  cv::Mat first(const std::string& source) const {
    return open_frames((shared_ / "cases" / source).string(), PixelFormat::colour)->read(0).clone();
  }
};

double difference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total() * a.channels());
}

TEST_F(RealFootage, APortraitVideoIsUpright) {
  const fs::path folder = "01-portrait-video-upside-down";
  const cv::Mat frame = first(folder / "phone.mp4"),
                shown = cv::imread((shared_ / "cases" / folder / "as_every_player_shows_it.jpg").string());
  ASSERT_EQ(frame.size(), shown.size());
  EXPECT_LT(difference(frame, shown), 5.0) << "21.6 upside down";
}

TEST_F(RealFootage, ImagesOfTwoOrientationsShowTheSame) {
  const fs::path folder = "03-exif-orientation";
  const cv::Mat upright = first(folder / "orientation1/{frame:06}.jpg"),
                turned = first(folder / "orientation6/{frame:06}.jpg");
  ASSERT_EQ(upright.size(), turned.size());
  EXPECT_LT(difference(upright, turned), 5.0);
}

/// The clip of one camera in a street, without masks and motion.
constexpr char kWild[] = R"(
doppel_capture: 1
name: wild
root: ROOT
character: character/ddc.character
calibration: wild/camera.calibration
fps: 25
landmarks: landmarks.csv
keypoint_map: body25
sequences:
  - name: street
    split: test
    videos: wild/videos/stream{camera:03}.mp4
    background_subtraction: {frames: [0, 19]}
    keypoints: wild/keypoints/{camera:03}/stream{camera:03}_{frame:012}_keypoints.json
    joints3d: wild/joints3d.csv
    first_frame: 20
)";

/// The share of sure keypoints that lie on the mask, give or take some pixels.
double share_on_mask(const Dataset& dataset, const SampleId& sample) {
  cv::Mat distance;
  cv::distanceTransform(~dataset.mask(sample, 0), distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  int sure = 0, on = 0;
  for (const Keypoint& point : dataset.keypoints(sample, 0)) {
    if (point.confidence < 0.7f) continue;
    ++sure;
    const cv::Point at(static_cast<int>(point.x), static_cast<int>(point.y));
    on += at.inside({{}, distance.size()}) && distance.at<float>(at) < 5.0f;
  }
  return static_cast<double>(on) / std::max(1, sure);
}

TEST_F(RealData, PreparesTheWildClipWithoutMasksAndMotion) {
  const support::TemporaryFolder folder;
  support::write_bytes(folder / "capture.yaml", support::replaced(kWild, "ROOT", capture_folder().string()));
  PrepareOptions options;
  options.out = folder / "prepared";
  const PrepareReport report = prepare_capture(read_capture(folder / "capture.yaml"), options);
  ASSERT_EQ(report.cameras.size(), 1u);
  EXPECT_EQ(report.cameras[0].frames, 60);
  EXPECT_EQ(report.cameras[0].empty_frames, 0);
  EXPECT_EQ(report.cameras[0].border_touch, 0.0);
  EXPECT_EQ(report.cameras[0].keypoints->nobody, 0);
  const Dataset dataset = Dataset::open(options.out);
  ASSERT_EQ(dataset.landmarks().size(), 25u);
  double on_mask = 0.0, overlap = 0.0;
  cv::Mat before;
  for (const SampleId& sample : dataset.samples(Split::test)) {
    const cv::Mat mask = dataset.mask(sample, 0);
    on_mask += share_on_mask(dataset, sample) / 60.0;
    if (!before.empty()) overlap += iou(mask, before) / 59.0;
    before = mask;
    const double share = static_cast<double>(cv::countNonZero(mask)) / static_cast<double>(mask.total());
    EXPECT_GT(share, 0.24) << sample.frame << ": feet, hair or an arm are missing";
    EXPECT_LT(share, 0.275) << sample.frame << ": the shadow was taken along";
  }
  RecordProperty("keypoints_on_mask", std::to_string(on_mask));
  RecordProperty("iou_of_neighbouring_frames", std::to_string(overlap));
  EXPECT_GT(on_mask, 0.97);
  EXPECT_GT(overlap, 0.93);
  const Batch batch = make_batch(dataset, {{0, 25}}, {{0}}, {2});
  EXPECT_FALSE(batch.dofs.defined());
  EXPECT_TRUE(batch.valid.all().item<bool>());
}

}  // namespace
}  // namespace doppel::real_capture_test
