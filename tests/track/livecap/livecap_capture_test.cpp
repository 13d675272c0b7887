#include "doppel/track/livecap/livecap_capture.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/track/energy/outline.h"
#include "support/message_of.h"
#include "track/tube_capture.h"

namespace doppel::livecap_capture_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using ::testing::HasSubstr;

class LivecapCapture : public TrackCapture {
 protected:
  LivecapCaptureOptions options(const std::string& out) const {
    LivecapCaptureOptions options;
    options.out = root() / out;
    options.vertices = true;
    options.config.fit.min_keypoints = 6;  // of eight
    return options;
  }
  nlohmann::ordered_json track(const LivecapCaptureOptions& options) const {
    return to_json(track_livecap(*Footage::open(root(), options.config.fit.outline_pixels, "c1"), options));
  }
};

TEST_F(LivecapCapture, FindsMotionAndSurfaceWithOneCamera) {
  const auto report = track(options("tracked"));
  EXPECT_EQ(report["method"], "livecap");
  const auto& walk = report["sequences"]["walk"];
  EXPECT_EQ(walk["lost_frames"].dump(), "[3]");
  EXPECT_EQ(walk["initialised"], 2) << "at the beginning and at the cut";
  EXPECT_EQ(walk["recovered"], 1) << "after the frame in which nobody was detected";
  // Not .93: outlines weigh less than they did, so that clothes do not pull the body.
  EXPECT_GT(walk["livecap"]["IoU"].get<double>(), 0.92);
  int masked = 0;
  for (const auto& frame : walk["per_frame"]) masked += frame.contains("IoU_of_surface");
  EXPECT_EQ(masked, kFrames - 1);
  EXPECT_GT(walk["livecap"]["frames_per_second"].get<double>(), 0.0);

  const Motion motion = read_motion(root() / "tracked/walk.motion", character_.num_dofs());
  ASSERT_EQ(motion.num_frames(), kFrames);
  for (int frame = 0; frame < kFrames; ++frame) EXPECT_LT(error(motion, frame), 0.06) << "frame " << frame;
  EXPECT_TRUE(fs::exists(root() / "tracked/walk.bvh"));
  EXPECT_TRUE(fs::exists(root() / "tracked/capture.yaml"));
  const NpyArray vertices = read_npy(root() / "tracked/walk_vertices.npy");
  EXPECT_EQ(vertices.shape, (std::vector<std::int64_t>{kFrames, character_.num_vertices(), 3}));
}

TEST_F(LivecapCapture, SameFilesWithAnyNumberOfThreads) {
  const int before = at::get_num_threads();
  at::set_num_threads(1);
  track(options("one"));
  at::set_num_threads(3);
  track(options("three"));
  at::set_num_threads(before);
  const auto bytes = [&](const std::string& file) {
    std::ifstream in(root() / file, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  EXPECT_EQ(bytes("one/walk_vertices.npy"), bytes("three/walk_vertices.npy"));
  EXPECT_EQ(bytes("one/walk.motion"), bytes("three/walk.motion"));
}

TEST_F(LivecapCapture, FiltersTheVertices) {
  LivecapCaptureOptions plain = options("plain");
  plain.config.filter = false;
  track(plain);
  track(options("filtered"));
  const NpyArray raw = read_npy(root() / "plain/walk_vertices.npy");
  const NpyArray filtered = read_npy(root() / "filtered/walk_vertices.npy");
  const auto frame = 3u * as_size(character_.num_vertices());
  const auto a = raw.as<float>(), b = filtered.as<float>();
  for (std::size_t i = 0; i < frame; i += 17) {
    EXPECT_NEAR(b[frame + i], 0.15f * a[i] + 0.7f * a[frame + i] + 0.15f * a[2 * frame + i], 1e-5f);
    EXPECT_NEAR(b[i], 0.85f * a[i] + 0.15f * a[frame + i], 1e-5f) << "the first frame has nothing before it";
  }
}

TEST_F(LivecapCapture, IsComparedWithTheGroundTruth) {
  Motion motion;
  for (int frame = 0; frame < kFrames; ++frame) {
    motion.ids.push_back(frame);
    motion.frames.push_back(ground_truth(frame));
  }
  write_motion(root() / "ground_truth.motion", motion, true);
  std::string capture = read_file(root() / "capture.yaml");
  capture.replace(capture.find("cuts:"), 0, "motion: ground_truth.motion, ");
  write_atomically(root() / "capture.yaml", capture);
  const auto write_surfaces = [&](const Eigen::Vector3d& shift) {
    NpyStream file(root() / "ground_truth/walk/vertices.npy", {character_.num_vertices(), 3});
    for (int frame = 0; frame < kFrames; ++frame) {
      std::vector<float> numbers;
      for (const Eigen::Vector3d& vertex : posed_vertices(model_, model_.pose(ground_truth(frame), false)))
        for (int axis = 0; axis < 3; ++axis) numbers.push_back(static_cast<float>(vertex[axis] + shift[axis]));
      file.append(numbers);
    }
    file.close();
  };
  write_surfaces({0.0, 0.0, 0.0});
  const auto here = track(options("here"))["sequences"]["walk"];
  write_surfaces({0.1, -0.2, 0.5});
  const auto there = track(options("there"))["sequences"]["walk"];

  const auto& joints = here["against_given_motion"];
  EXPECT_GT(joints["aligned_landmarks_mm"].get<double>(), 0.0);
  EXPECT_LT(joints["aligned_landmarks_mm"].get<double>(), joints["landmarks_mm"].get<double>());
  for (const char* key : {"vertex_error_pose_mm", "vertex_error_mm"}) {
    EXPECT_GT(here["against_true_surface"][key].get<double>(), 0.0) << key;
    EXPECT_LT(here["against_true_surface"][key].get<double>(), 40.0) << key;
    EXPECT_NEAR(here["against_true_surface"][key].get<double>(), there["against_true_surface"][key].get<double>(), 1e-3)
        << key << ": a shift is taken away";
  }
  double sum = 0.0;
  for (const auto& frame : here["per_frame"]) sum += frame["vertices_mm"].get<double>() / kFrames;
  EXPECT_NEAR(sum, here["against_true_surface"]["vertex_error_mm"].get<double>(), 1e-9);
  const std::string page = read_file(root() / "here/track.html");
  for (const char* chart : {"Overlap with the mask", "Joints from the true ones", "Vertices from the true ones"})
    EXPECT_THAT(page, HasSubstr(chart));

  LivecapCaptureOptions fewer = options("fewer");
  fewer.vertices = false;
  EXPECT_FALSE(track(fewer)["sequences"]["walk"]["against_true_surface"].contains("vertex_error_mm"));
  const float number = 0.0f;
  write_npy(root() / "ground_truth/walk/vertices.npy", &number, {1, 1, 1});
  EXPECT_THAT(message_of<Error>([&] { track(fewer); }), HasSubstr("expected 10 frames or more"));
}

TEST_F(LivecapCapture, SaysWhatIsWrong) {
  EXPECT_THAT(message_of<UsageError>([&] { track_livecap(*Footage::open(root(), 128), options("tracked")); }),
              HasSubstr("choose one of c0, c1, c2, c3 with --camera"));
  EXPECT_THAT(message_of<Error>([&] { Footage::open(root(), 128, "c9"); }), HasSubstr("c9"));
  LivecapCaptureOptions wrong = options("tracked");
  wrong.sequences = {"run"};
  EXPECT_THAT(message_of<UsageError>([&] { track(wrong); }), HasSubstr("it has walk"));
  const auto config_of = [](const std::string& text) {
    return read_livecap_config(ConfigDocument::parse(text, "livecap.yaml"));
  };
  EXPECT_EQ(config_of("surface: {photometric: {weight: 0}}").fit.nonrigid.photometric_weight, 0.0);
  EXPECT_THAT(message_of<Error>([&] { config_of("surface: {photometric: {kernels: [4]}}"); }), HasSubstr("odd"));
  EXPECT_THAT(message_of<Error>([&] { config_of("surface: {snapp: true}"); }), HasSubstr("snap"));
}

}  // namespace
}  // namespace doppel::livecap_capture_test
