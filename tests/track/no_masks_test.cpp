// Captures without masks: the pose follows from keypoints alone.
#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>

#include "doppel/track/livecap/livecap_capture.h"
#include "doppel/track/track_capture.h"
#include "support/message_of.h"
#include "track/tube_capture.h"

namespace doppel::no_masks_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using ::testing::HasSubstr;

class NoMasks : public TrackCapture {
 protected:
  /// The fixture's capture with other `videos` and `masks`. @return its folder
  void write_capture_with(const std::string& files) const {
    std::ofstream(root() / "capture.yaml")
        << "doppel_capture: 1\nname: tube\ncharacter: " << fs::relative(character_file_, root()).string()
        << "\ncalibration: cameras.yml\nlandmarks: landmarks.csv\nsequences:\n  - {name: walk, split: test, " << files
        << ", keypoints: points.csv, joints3d: 'joints_{name}.csv', cuts: [" << kCut << "]}\n";
  }
  Motion tracked(const std::string& out, int sheet_frames = 0) const {
    TrackOptions options;
    options.out = root() / out;
    options.sheet_frames = sheet_frames;
    const auto footage = Footage::open(root(), options.config.fit.outline_pixels);
    ::testing::internal::CaptureStderr();
    ::testing::internal::CaptureStdout();
    track_capture(*footage, options);
    log_ = ::testing::internal::GetCapturedStderr() + ::testing::internal::GetCapturedStdout();
    return read_motion(options.out / "walk.motion", character_.num_dofs());
  }
  double distance(const Motion& a, const Motion& b, int frame) const {
    const PosedBody left = model_.pose(a.frames[frame], false);
    const PosedBody right = model_.pose(b.frames[frame], false);
    double worst = 0.0;
    for (int m = 0; m < model_.num_landmarks(); ++m)
      worst = std::max(worst, (model_.landmark(left, m) - model_.landmark(right, m)).norm());
    return worst;
  }
  mutable std::string log_;
};

constexpr char kFilmed[] = "videos: 'mask_{name}_{frame}.png'";  // the masks are images, too

TEST_F(NoMasks, JointsStayWhereTheyAreWithMasks) {
  const Motion with_masks = tracked("with");
  EXPECT_THAT(log_, ::testing::Not(HasSubstr("no masks")));
  write_capture_with(kFilmed);
  const Motion without = tracked("without", 2);
  for (int frame = 0; frame < kFrames; ++frame) {
    if (frame == 3) continue;  // nobody was detected
    EXPECT_LT(distance(with_masks, without, frame), 0.003) << "frame " << frame;
    EXPECT_LT(error(without, frame), 0.004) << "frame " << frame;
  }
  EXPECT_EQ(log_.find("no masks in walk"), log_.rfind("no masks in walk")) << "one warning";
  EXPECT_THAT(log_, HasSubstr("no masks in walk"));
  EXPECT_FALSE(cv::imread((root() / "without/walk.jpg").string()).empty());
}

TEST_F(NoMasks, KeypointsNeedNoImagesIfTheLastFrameIsStated) {
  write_capture_with("videos: 'none_{name}.mp4', last_frame: 9");
  const Motion motion = tracked("without", 2);
  for (const int frame : {0, 5, 9}) EXPECT_LT(error(motion, frame), 0.004) << "frame " << frame;
  write_capture_with("videos: 'none_{name}.mp4'");
  EXPECT_THAT(message_of([&] { tracked("again"); }), HasSubstr("does not exist"));
}

TEST_F(NoMasks, TheSurfaceNeedsThem) {
  write_capture_with(kFilmed);
  TrackOptions options;
  options.out = root() / "tracked";
  options.surface = true;
  const auto footage = Footage::open(root(), 128);
  const std::string error = message_of([&] { track_capture(*footage, options); });
  for (const char* part : {"sequence walk", "--surface", "masks", "background_subtraction"})
    EXPECT_THAT(error, HasSubstr(part));
  options.surface = false;
  options.config.template_frames = 2;
  EXPECT_THAT(message_of([&] { track_capture(*footage, options); }), HasSubstr("template fit"));
}

TEST_F(NoMasks, OneCameraFollowsTheKeypoints) {
  write_capture_with(kFilmed);
  LivecapCaptureOptions options;
  options.out = root() / "tracked";
  options.sheet_frames = 1;
  const TrackReport report = track_livecap(*Footage::open(root(), 128, cameras_.front().name), options, nullptr);
  ASSERT_EQ(report.sequences.size(), 1u);
  EXPECT_TRUE(report.sequences[0].livecap->empty()) << "no mask to overlap with";
  EXPECT_LT(report.sequences[0].lost_frames().size(), 3u);
}

TEST_F(NoMasks, ACaptureWithoutCharacterSaysHowToMakeOne) {
  std::ofstream(root() / "capture.yaml") << "doppel_capture: 1\nname: tube\ncalibration: cameras.yml\nsequences:\n"
                                         << "  - {name: walk, split: test, " << kFilmed << ", keypoints: points.csv}\n";
  EXPECT_THAT(message_of([&] { Footage::open(root(), 128); }), HasSubstr("doppel character create"));
}

}  // namespace
}  // namespace doppel::no_masks_test
