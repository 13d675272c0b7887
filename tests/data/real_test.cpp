#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "doppel/data/capture_layouts.h"
#include "doppel/data/dataset.h"
#include "doppel/data/prepare.h"
#include "doppel/data/video.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel {
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

// The studio is green and its empty pictures are given: both ways of keying must come near the true masks.
TEST_F(RealData, ChromaKeyComesNearTheTrueMasks) {
  const auto videos = open_frames((capture_folder() / "training/videos/stream003.mp4").string(), PixelFormat::colour);
  const auto masks =
      open_frames((capture_folder() / "training/foregroundSegmentation/stream003.mkv").string(), PixelFormat::grey);
  const cv::Mat background = cv::imread((capture_folder() / "background/003.png").string());
  for (const long frame : {0L, 40L}) {
    const cv::Mat picture = videos->read(frame), truth = threshold_mask(masks->read(frame), 128);
    for (const auto space : {ChromaKey::Space::hsv, ChromaKey::Space::ycrcb}) {
      ChromaKey key;
      key.space = space;
      key.against_background = true;
      const cv::Mat mask = largest_component(chroma_key_mask(picture, key, background));
      const double iou = static_cast<double>(cv::countNonZero(mask & truth)) / cv::countNonZero(mask | truth);
      EXPECT_GT(iou, 0.9) << static_cast<int>(space) << " " << frame;
    }
  }
}

}  // namespace
}  // namespace doppel
