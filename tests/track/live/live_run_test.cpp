#include "doppel/track/live/live_run.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>

#include <opencv2/videoio.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/core/process.h"
#include "support/message_of.h"
#include "track/live/live_fixture.h"

namespace doppel::live_run_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> states_of(const nlohmann::ordered_json& report) {
  std::vector<std::string> states;
  for (const auto& change : report["sequences"]["live"]["live"]["states"])
    states.push_back(fmt::format("{} {}", change["picture"].get<long>(), change["state"].get<std::string>()));
  return states;
}

TEST_F(LiveCapture, TracksAFolderOfImagesAndDropsNone) {
  LiveView seen = view();
  const auto source = open_source((root() / "film").string());
  const auto solver = livecap_tracker(seen, config());
  const auto report = to_json(track_live(*source, seen, *solver, options("out")));
  const auto& sequence = report["sequences"]["live"];
  EXPECT_EQ(sequence["frames"], kFrames);
  EXPECT_EQ(sequence["live"]["pictures"], kFrames);
  EXPECT_EQ(sequence["live"]["dropped"], 0);
  EXPECT_LE(sequence["live"]["pictures_behind"].get<long>(), 4);
  EXPECT_GT(sequence["live"]["frames_per_second"].get<double>(), 0.0);
  EXPECT_GT(sequence["live"]["latency_ms"]["largest"].get<double>(), 0.0);
  EXPECT_THAT(states_of(report), ElementsAre("0 tracking", "3 lost", "4 recovered")) << "nobody was detected in one";
  const Motion motion = read_motion(root() / "out/live.motion", character_.num_dofs());
  ASSERT_EQ(motion.num_frames(), kFrames);
  for (const int frame : {0, 1, 2, 4, 5, 9}) EXPECT_LT(error(motion, frame), 0.06) << "frame " << frame;
  EXPECT_TRUE(fs::exists(root() / "out/live.bvh"));
  EXPECT_EQ(read_npy(root() / "out/live_vertices.npy").shape,
            (std::vector<std::int64_t>{kFrames, character_.num_vertices(), 3}));
  EXPECT_EQ(nlohmann::ordered_json::parse(read_file(root() / "out/track.json")), report);
}

TEST_F(LiveCapture, EachPoseIsHandedOnAsItIsWritten) {
  LiveView seen = view();
  const auto source = open_source((root() / "film").string());
  const auto solver = livecap_tracker(seen, config());
  LiveRunOptions with = options("handed");
  with.smoothing = 0.0;  // of the written motion alone
  std::vector<std::vector<double>> poses;
  std::vector<bool> tracked;
  with.on_pose = [&](const std::vector<double>& dofs, double seconds, bool seen_now) {
    EXPECT_GE(seconds, 0.0);
    poses.push_back(dofs);
    tracked.push_back(seen_now);
  };
  track_live(*source, seen, *solver, with);
  const Motion motion = read_motion(root() / "handed/live.motion", character_.num_dofs());
  ASSERT_EQ(poses.size(), motion.frames.size());
  for (std::size_t f = 0; f < poses.size(); ++f)
    for (std::size_t d = 0; d < poses[f].size() && tracked[f]; ++d)  // the written motion bridges lost frames
      EXPECT_NEAR(poses[f][d], motion.frames[f][d], 1e-6) << "frame " << f;
  EXPECT_FALSE(tracked[3]) << "nobody was detected in this one";
  EXPECT_TRUE(tracked[2] && tracked[4]);
}

TEST_F(LiveCapture, SameFilesWithAnyNumberOfThreads) {
  const int before = at::get_num_threads();
  for (const int threads : {1, 4}) {
    at::set_num_threads(threads);
    LiveView seen = view();
    const auto source = open_source((root() / "film").string());
    const auto solver = livecap_tracker(seen, config());
    track_live(*source, seen, *solver, options(fmt::format("with{}", threads)));
  }
  at::set_num_threads(before);
  for (const char* file : {"live.motion", "live_vertices.npy"})
    EXPECT_EQ(read_file(root() / "with1" / file), read_file(root() / "with4" / file)) << file;
}

TEST_F(LiveCapture, ALiveSourceIsNeverWaitedFor) {
  LiveView seen = view();
  FakeSource source(std::vector<cv::Mat>(30, image(0)), true, [](long) { return 0.01; });
  SlowTracker solver(seen, 0.06);
  const auto report = to_json(track_live(source, seen, solver, options("live")));
  const auto& live = report["sequences"]["live"]["live"];
  const long dropped = live["dropped"], images = live["pictures"], tracked = report["sequences"]["live"]["frames"];
  EXPECT_EQ(images, 30);
  EXPECT_GE(dropped, 10);
  EXPECT_EQ(dropped + tracked, images);
}

TEST_F(LiveCapture, ASourceThatFallsSilentIsFoundAgain) {
  LiveView seen = view();
  FakeSource source(std::vector<cv::Mat>(8, image(0)), true, [](long number) { return number == 4 ? 1.5 : 0.05; });
  SlowTracker solver(seen, 0.0);
  LiveRunOptions wanted = options("silent");
  wanted.silence = 0.7;
  const auto report = to_json(track_live(source, seen, solver, wanted));
  EXPECT_EQ(solver.pauses, 1);
  EXPECT_THAT(states_of(report), ::testing::Contains(HasSubstr("recovered")));
}

TEST_F(LiveCapture, EndsWhenAskedToAndKeepsWhatWasTracked) {
  LiveView seen = view();
  FakeSource source(std::vector<cv::Mat>(1000, image(0)), true, [](long number) {
    if (number == 12) request_stop();
    return 0.02;
  });
  SlowTracker solver(seen, 0.0);
  const auto report = to_json(track_live(source, seen, solver, options("stopped")));
  request_stop(false);
  const long frames = report["sequences"]["live"]["frames"];
  EXPECT_GT(frames, 3);
  EXPECT_LT(frames, 30);
  EXPECT_EQ(read_motion(root() / "stopped/live.motion", character_.num_dofs()).num_frames(), frames);
}

TEST_F(LiveCapture, BlackImagesAndAWrongWallAreNoReasonToFall) {
  std::vector<cv::Mat> all = images();
  for (const int frame : {4, 5}) all[frame].setTo(0);
  for (const bool wrong_wall : {false, true}) {
    if (wrong_wall) cv::imwrite((root() / "empty.png").string(), cv::Mat(192, 192, CV_8UC3, cv::Scalar(250, 10, 200)));
    LiveView seen = view();
    FakeSource source(all, false);
    const auto solver = livecap_tracker(seen, config());
    const std::string out = wrong_wall ? "wrong" : "black";
    const auto report = to_json(track_live(source, seen, *solver, options(out)));
    for (const float x : read_npy(root() / out / "live_vertices.npy").as<float>()) ASSERT_TRUE(std::isfinite(x));
    EXPECT_EQ(report["sequences"]["live"]["lost_frames"].dump(), "[3]") << "keypoints hold what masks do not";
    const Motion motion = read_motion(root() / out / "live.motion", character_.num_dofs());
    EXPECT_LT(error(motion, kFrames - 1), 0.15);
  }
}

TEST_F(LiveCapture, NobodyAtAllIsReported) {
  LiveView seen = view();
  FakeSource source(std::vector<cv::Mat>(5, wall()), false);
  std::ofstream(root() / "points.csv") << "frame,camera,name,x,y,confidence\n0,c1,landmark_0,5,5,0.9\n";
  LiveView nobody = view();
  const auto solver = livecap_tracker(nobody, config());
  const auto report = to_json(track_live(source, nobody, *solver, options("nobody")));
  EXPECT_THAT(states_of(report), ElementsAre("0 lost"));
  EXPECT_FALSE(fs::exists(root() / "nobody/live.motion"));
  FakeSource nothing({}, false);
  EXPECT_THAT(message_of<Error>([&] { track_live(nothing, nobody, *solver, options("nothing")); }),
              HasSubstr("delivered no image"));
}

TEST_F(LiveCapture, LearnsTheEmptySceneFromTheSource) {
  write_yaml("unknown.yaml", "masks: 'none_{frame}.png'");
  LiveView seen = view("unknown.yaml");
  seen.learn_empty_scene({wall(), wall()});
  FakeSource source(images(), false);
  const SourceImage first = *source.next();
  FootageFrame found = seen.preprocess(first);
  seen.detect(first, found);
  const cv::Mat expected = mask_of(model_, cameras_[1], ground_truth(0));
  EXPECT_LT(cv::countNonZero(found.masks.front() != expected), cv::countNonZero(expected) / 10);
  EXPECT_EQ(found.evidence.front().keypoints.size(), landmarks_.size());
  EXPECT_EQ(found.joints.front().size(), landmarks_.size());
  EXPECT_FALSE(found.evidence.front().outline.empty());
}

TEST_F(LiveCapture, HoldsNoMoreMemoryHoweverLongItGoesOn) {
  LiveView seen = view();
  SourceOptions playing;
  playing.repeat = 40;
  const auto source = open_source((root() / "film").string(), playing);
  const auto solver = livecap_tracker(seen, config());
  const auto report = to_json(track_live(*source, seen, *solver, options("long")));
  EXPECT_EQ(report["sequences"]["live"]["frames"], 40 * kFrames);
  const auto& memory = report["sequences"]["live"]["live"]["memory_mb"];
  EXPECT_GT(memory["after_100_frames"].get<double>(), 0.0);
  EXPECT_LT(memory["at_the_end"].get<double>() - memory["after_100_frames"].get<double>(), 8.0);
}

TEST_F(LiveCapture, SaysWhatIsMissing) {
  const auto complaint = [&](const LiveViewOptions& wrong) {
    return message_of<Error>([&] { LiveView(root() / "live.yaml", {192, 192}, wrong); });
  };
  LiveViewOptions wrong;
  EXPECT_THAT(complaint(wrong), HasSubstr("c0, c1, c2, c3"));
  wrong.camera = "c1";
  wrong.from_camera = true;
  EXPECT_THAT(complaint(wrong), HasSubstr("no `detector`"));
  wrong.from_camera = false;
  wrong.sequence = "run";
  EXPECT_THAT(complaint(wrong), HasSubstr("it has walk"));
  wrong.sequence.clear();
  EXPECT_THAT(message_of<Error>([&] { LiveView(root() / "live.yaml", {192, 100}, wrong); }), HasSubstr("--source"));
}

TEST_F(LiveCapture, ThePreviewShowsEveryFrameInAFilm) {
  LiveView seen = view();
  FakeSource source(images(), false);
  const auto solver = livecap_tracker(seen, config());
  const fs::path film = root() / "films/preview.mp4";
  const auto preview = open_preview(film.string(), seen.camera(), seen.character().mesh, 25.0);
  track_live(source, seen, *solver, options("shown"), preview.get());
  cv::VideoCapture video(film.string());
  EXPECT_EQ(video.get(cv::CAP_PROP_FRAME_COUNT), kFrames);
  EXPECT_EQ(video.get(cv::CAP_PROP_FRAME_WIDTH), 2 * 192);
}

}  // namespace
}  // namespace doppel::live_run_test
