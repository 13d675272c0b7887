#include "doppel/track/track_capture.h"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "doppel/character/dof_names.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "track/tube_capture.h"

namespace doppel::track_capture_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using ::testing::HasSubstr;

TEST_F(TrackCapture, FindsTheMotionOfACaptureThatHasNone) {
  TrackOptions options;
  options.out = root() / "tracked";
  options.config.smoothing = 0.0;
  options.vertices = true;
  const auto footage = Footage::open(root(), options.config.fit.outline_pixels);
  ASSERT_EQ(footage->sequences().size(), 1u);
  EXPECT_EQ(footage->sequences()[0].num_frames(), kFrames);
  const auto report = to_json(track_capture(*footage, options));

  const auto& walk = report["sequences"]["walk"];
  EXPECT_EQ(walk["lost_frames"].dump(), "[3]");
  EXPECT_EQ(walk["initialised"], 2) << "at the beginning and at the cut";
  EXPECT_EQ(walk["recovered"], 1) << "after the frame in which nobody was detected";
  EXPECT_EQ(walk["per_frame"].size(), as_size(kFrames));
  EXPECT_FALSE(walk.contains("against_given_motion"));

  const Motion motion = read_motion(options.out / "walk.motion", character_.num_dofs());
  ASSERT_EQ(motion.num_frames(), kFrames);
  for (int frame = 0; frame < kFrames; ++frame)
    EXPECT_LT(error(motion, frame), frame == 3 ? 0.01 : 0.004) << "frame " << frame;
  EXPECT_TRUE(fs::exists(options.out / "walk.bvh"));
  EXPECT_FALSE(cv::imread((options.out / "walk.jpg").string()).empty());
  const NpyArray vertices = read_npy(options.out / "walk_vertices.npy");
  EXPECT_EQ(vertices.shape, (std::vector<std::int64_t>{kFrames, character_.num_vertices(), 3}));
}

TEST_F(TrackCapture, WritesACaptureThatNamesTheMotion) {
  TrackOptions options;
  options.out = root() / "tracked";
  options.sheet_frames = 0;
  track_capture(*Footage::open(root(), 128), options);
  const Capture capture = read_capture(options.out);
  ASSERT_EQ(capture.sequences.size(), 1u);
  EXPECT_EQ(capture.sequences[0].motion, "tracked/walk.motion");
  EXPECT_EQ(capture.sequences[0].cuts, std::vector<long>{kCut});
  EXPECT_EQ(fs::canonical(capture.root), fs::canonical(root()));
  EXPECT_TRUE(fs::exists(capture.resolve(capture.sequences[0].motion)));

  // Tracked again with a motion given, the report says how far apart the two are.
  const auto again = Footage::open(options.out, 128);
  TrackOptions second = options;
  second.out = root() / "again";
  const auto report = to_json(track_capture(*again, second));
  EXPECT_LT(report["sequences"]["walk"]["against_given_motion"]["landmarks_mm"].get<double>(), 1e-3);
}

TEST_F(TrackCapture, KeypointFilesMayCountFramesFromAnotherNumber) {
  TrackOptions options;
  options.out = root() / "tracked";
  options.sheet_frames = 0;
  track_capture(*Footage::open(root(), options.config.fit.outline_pixels), options);

  std::istringstream lines(read_file(root() / "points.csv"));
  std::string line, shifted, offsets;
  for (int row = 0; std::getline(lines, line); ++row)
    shifted += (row == 0 ? line : std::to_string(std::stol(line) + 5) + line.substr(line.find(','))) + "\n";
  write_atomically(root() / "points.csv", shifted);
  for (const PinholeCamera& camera : cameras_) offsets += (offsets.empty() ? "" : ", ") + ('"' + camera.name + "\": 5");
  write_atomically(root() / "capture.yaml", support::replaced(read_file(root() / "capture.yaml"),
                                                              "cuts: ", "keypoint_offset: {" + offsets + "}, cuts: "));
  options.out = root() / "shifted";
  track_capture(*Footage::open(root(), options.config.fit.outline_pixels), options);
  EXPECT_EQ(read_file(root() / "shifted/walk.motion"), read_file(root() / "tracked/walk.motion"));
}

TEST_F(TrackCapture, WritesNoCutsBehindTheLastFrame) {
  TrackOptions options;
  options.out = root() / "tracked";
  options.sheet_frames = 0;
  options.limit_frames = 2;
  track_capture(*Footage::open(root(), 128), options);
  EXPECT_TRUE(read_capture(options.out).sequences.at(0).cuts.empty());
}

TEST_F(TrackCapture, FoldersBelongToOneMethodAndVerticesToOneRun) {
  TrackOptions options;
  options.out = root() / "tracked";
  options.sheet_frames = 0;
  options.vertices = true;
  const auto footage = Footage::open(root(), 128);
  track_capture(*footage, options);
  EXPECT_EQ(tracked_method(options.out), "multiview");
  EXPECT_TRUE(fs::exists(options.out / "walk_vertices.npy"));
  options.vertices = false;
  track_capture(*footage, options);
  EXPECT_FALSE(fs::exists(options.out / "walk_vertices.npy")) << "those of the run before";
  EXPECT_THAT(support::message_of<UsageError>([&] { check_tracked_method(options.out, "livecap"); }),
              HasSubstr("holds the tracking of the method multiview, and this is livecap"));
}

TEST_F(TrackCapture, KeepsDescriptionsOfOthers) {
  fs::create_directories(root() / "mine");
  write_atomically(root() / "mine/capture.yaml", "# by hand\n");
  TrackOptions options;
  options.out = root() / "mine";
  EXPECT_THAT(support::message_of<UsageError>([&] { track_capture(*Footage::open(root(), 128), options); }),
              HasSubstr("does not say that doppel wrote it"));
  EXPECT_EQ(read_file(root() / "mine/capture.yaml"), "# by hand\n");
}

TEST_F(TrackCapture, FitsSharedDofsBeforeItTracks) {
  TrackOptions options;
  options.out = root() / "tracked";
  options.config.smoothing = 0.0;
  options.config.shared_dofs = {"lean_3"};
  options.config.shared_frames = 5;
  options.config.fit.shared_dofs.weight = 0.1;
  options.sheet_frames = 0;
  const auto report = to_json(track_capture(*Footage::open(root(), options.config.fit.outline_pixels), options));
  const std::size_t lean = as_size(find_dofs(character_.skeleton, "lean_3").at(0));
  double mean = 0.0;
  for (int frame = 0; frame < kFrames; ++frame) mean += ground_truth(frame)[lean] / kFrames;
  ASSERT_EQ(report["usual"].size(), 1u);
  EXPECT_NEAR(report["usual"]["lean_3"].get<double>(), mean, 0.1);
  const Motion motion = read_motion(options.out / "walk.motion", character_.num_dofs());
  for (int frame = 0; frame < kFrames; ++frame)
    EXPECT_LT(error(motion, frame), frame == 3 ? 0.01 : 0.004) << "frame " << frame;

  options.config.shared_dofs = {"lean_9"};
  EXPECT_THAT(message_of<UsageError>([&] { track_capture(*Footage::open(root(), 128), options); }),
              HasSubstr("`shared_dofs.dofs` names 'lean_9'"));
}

TEST_F(TrackCapture, NamesACameraWithoutFrames) {
  std::string capture = read_file(root() / "capture.yaml");
  capture.insert(capture.find(", cuts:"), fmt::format(", frame_offset: {{{}: 50}}", cameras_[1].name));
  write_atomically(root() / "capture.yaml", capture);
  EXPECT_THAT(message_of([&] { Footage::open(root(), 128); }),
              HasSubstr("camera c1 filmed no frame of it, with the 10 frames"));
}

TEST_F(TrackCapture, SaysWhatIsWrong) {
  const auto footage = Footage::open(root(), 128);
  TrackOptions options;
  options.out = root();
  EXPECT_THAT(message_of<UsageError>([&] { track_capture(*footage, options); }), HasSubstr("holds the capture itself"));
  options.out = root() / "tracked";
  options.sequences = {"run"};
  EXPECT_THAT(message_of<UsageError>([&] { track_capture(*footage, options); }), HasSubstr("it has walk"));
  options.sequences.clear();
  options.config.fit.min_keypoints = 1000;
  EXPECT_THAT(message_of<Error>([&] { track_capture(*footage, options); }),
              HasSubstr("found in none of its 10 frames"));

  const auto config_of = [](const std::string& text) {
    return read_track_config(ConfigDocument::parse(text, "fit.yaml"));
  };
  EXPECT_EQ(config_of("silhouette: {weight: 0}").fit.silhouette_weight, 0.0);
  const TrackConfig shared = config_of("shared_dofs: {dofs: ['lean_*'], frames: 3, weight: 7}");
  EXPECT_EQ(shared.shared_dofs, std::vector<std::string>{"lean_*"});
  EXPECT_EQ(shared.shared_frames, 3);
  EXPECT_EQ(shared.fit.shared_dofs.weight, 7.0);
  const TrackConfig strict = config_of("inliers: {threshold: 7, min_ratio: 0.25, min_keypoints: 5, max_distance: 0.5}");
  EXPECT_EQ(strict.fit.inlier_threshold, 7.0);
  EXPECT_EQ(strict.fit.min_inlier_ratio, 0.25);
  EXPECT_EQ(strict.fit.min_keypoints, 5);
  EXPECT_EQ(strict.fit.max_landmark_distance, 0.5);
  EXPECT_THAT(message_of<Error>([&] { config_of("silhouete: {weight: 0}"); }), HasSubstr("silhouette"));
  EXPECT_THAT(message_of<Error>([&] { config_of("inliers: {min_ratio: 2}"); }), HasSubstr("inliers.min_ratio"));
  EXPECT_THAT(message_of<UsageError>([&] {
                chosen_dofs({{"lean_9"}, {}, {}}, character_.skeleton, landmarks_);
              }),
              HasSubstr("the nearest is 'lean_"));
  const DofChoice choice{{"lean_1", "flex_*"}, {"lean_2"}, {"flex_2"}};
  std::vector<std::string> names;
  for (const int dof : chosen_dofs(choice, character_.skeleton, landmarks_))
    names.push_back(character_.skeleton.dofs[dof].name);
  EXPECT_EQ(names, (std::vector<std::string>{"lean_1", "flex_1", "lean_2", "flex_3"}));
}

}  // namespace
}  // namespace doppel::track_capture_test
