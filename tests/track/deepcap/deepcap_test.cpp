#include "doppel/track/deepcap/deepcap.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <opencv2/videoio.hpp>

#include "doppel/character/landmarks.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/track/deepcap/deepcap_tracker.h"
#include "doppel/track/deepcap/smoothed_surfaces.h"
#include "doppel/track/track_film.h"
#include "support/message_of.h"
#include "support/small_pose_run.h"
#include "support/temporary_folder.h"

namespace doppel::deepcap_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

/// The synthetic actor as it was filmed, and networks trained on it for a moment. In one frame nobody was detected.
class Deepcap : public support::SmallPoseRun {
 protected:
  static void SetUpTestSuite() {
    SmallPoseRun::SetUpTestSuite();
    write_atomically(*folder_ / "capture/testing/keypoints/001/stream001_000000000002_keypoints.json",
                     R"({"version": 1.3, "people": []})");
  }

  static DeepcapOptions options(const std::string& out) {
    DeepcapOptions options;
    options.run = *folder_ / "run";
    options.out = *folder_ / out;
    options.sequences = {"testing"};
    return options;
  }
  static std::unique_ptr<Footage> footage() { return Footage::open(*folder_ / "capture", 128, "1"); }
};

TEST_F(Deepcap, WritesMotionsSurfacesAndAFilmAndBridgesWhatNobodySaw) {
  DeepcapOptions wanted = options("tracked");
  wanted.vertices = true;
  wanted.smoothing = 0.0;
  const auto filmed = footage();
  const nlohmann::ordered_json report = to_json(track_deepcap(*filmed, wanted));
  const auto& sequence = report.at("sequences").at("testing");
  EXPECT_EQ(sequence.at("frames"), 4);
  EXPECT_EQ(sequence.at("lost_frames"), nlohmann::ordered_json({2}));
  EXPECT_TRUE(sequence.contains("against_given_motion"));

  const Skeleton& skeleton = filmed->character().skeleton;
  const Motion motion = read_motion(*folder_ / "tracked/testing.motion", skeleton.num_dofs());
  ASSERT_EQ(motion.num_frames(), 4);
  const auto root_height = [&](int frame) {
    return landmark_positions(skeleton, filmed->landmarks(), motion.frames[frame])[0];
  };
  // The position that was bridged lies between its neighbours'.
  EXPECT_LT((root_height(2) - 0.5 * (root_height(1) + root_height(3))).norm(),
            0.5 * (root_height(1) - root_height(3)).norm() + 0.02);

  const NpyArray vertices = read_npy(*folder_ / "tracked/testing_vertices.npy");
  EXPECT_EQ(vertices.shape, (std::vector<std::int64_t>{4, filmed->character().num_vertices(), 3}));
  const NpyArray graph = read_npy(*folder_ / "tracked/testing_graph.npy");
  EXPECT_EQ(graph.shape, (std::vector<std::int64_t>{4, filmed->character().num_nodes(), 6}));
  cv::VideoCapture film((*folder_ / "tracked/testing.mp4").string());
  EXPECT_EQ(film.get(cv::CAP_PROP_FRAME_COUNT), 4);
  EXPECT_EQ(film.get(cv::CAP_PROP_FRAME_WIDTH), 256);
  // The result is a capture that can be prepared.
  const Capture capture = read_capture(*folder_ / "tracked");
  EXPECT_EQ(fs::weakly_canonical(capture.resolve(capture.sequences.back().motion)),
            fs::weakly_canonical(*folder_ / "tracked/testing.motion"));
}

TEST_F(Deepcap, SmoothsTheVerticesAsTheThesisDoes) {
  const auto track = [](const std::string& out, DeepcapSmoothing smoothed, double sigma) {
    DeepcapOptions wanted = options(out);
    wanted.vertices = true;
    wanted.film = false;
    wanted.smoothed = smoothed;
    wanted.smoothing = sigma;
    track_deepcap(*footage(), wanted);
    const NpyArray array = read_npy(*folder_ / out / "testing_vertices.npy");
    return torch::tensor(array.as<float>()).view(array.shape).to(torch::kFloat64);
  };
  const torch::Tensor raw = track("raw", DeepcapSmoothing::poses, 0.0),
                      smooth = track("smooth", DeepcapSmoothing::vertices, 1.0);
  EXPECT_EQ(read_file(*folder_ / "raw/testing.motion"), read_file(*folder_ / "smooth/testing.motion"))
      << "the poses stay those of the networks";
  EXPECT_EQ(read_file(*folder_ / "raw/testing_graph.npy"), read_file(*folder_ / "smooth/testing_graph.npy"));
  const double near = std::exp(-0.5), far = std::exp(-2.0);  // of the five frames, the four that there are
  const std::vector<std::vector<double>> kernel{
      {1.0, near, far, 0.0}, {near, 1.0, near, far}, {far, near, 1.0, near}, {0.0, far, near, 1.0}};
  for (int frame = 0; frame < 4; ++frame) {
    const torch::Tensor weights = torch::tensor(kernel[static_cast<std::size_t>(frame)], torch::kFloat64);
    const torch::Tensor expected = (weights.view({4, 1, 1}) * raw).sum(0) / weights.sum();
    EXPECT_LT((smooth[frame] - expected).abs().max().item<double>(), 1e-6) << frame;
  }
}

TEST(SmoothedSurfaces, DoNotCrossACutAndComputeEachSurfaceOnce) {
  std::map<long, int> made;
  const auto surface = [&](long frame) {
    ++made[frame];
    return torch::full({2, 3}, static_cast<float>(frame));
  };
  SmoothedSurfaces surfaces(surface, 6, {0, 3}, 1.0);
  const double near = std::exp(-0.5), far = std::exp(-2.0);
  const auto value = [&](long frame) { return surfaces.at(frame)[1][2].item<float>(); };
  EXPECT_NEAR(value(0), (near * 1.0 + far * 2.0) / (1.0 + near + far), 1e-6);
  EXPECT_NEAR(value(1), 1.0, 1e-6);
  EXPECT_NEAR(value(2), (2.0 + near * 1.0) / (1.0 + near + far), 1e-6) << "frame 3 begins a segment";
  EXPECT_NEAR(value(3), (3.0 + near * 4.0 + far * 5.0) / (1.0 + near + far), 1e-6);
  value(4);
  value(5);
  for (const auto& [frame, count] : made) EXPECT_EQ(count, 1) << frame;
  EXPECT_EQ(made.size(), 6u);
  SmoothedSurfaces as_they_are(surface, 6, {}, 0.0);
  EXPECT_EQ(as_they_are.at(2)[0][0].item<float>(), 2.0f);
}

TEST_F(Deepcap, SeesInFilesWhatItSawInThePreparedCapture) {
  TrainedPose trained = TrainedPose::load(*folder_ / "run");
  const auto filmed = footage();
  DeepcapTracker tracker(trained, filmed->cameras()[0], filmed->landmarks());
  const int testing = filmed->sequences()[0].name == "testing" ? 0 : 1;
  const FootageFrame seen = filmed->read(testing)->read(1, true);
  const FrameResult found = tracker.capture(seen.images[0], seen.masks[0], seen.evidence[0].keypoints);
  ASSERT_TRUE(found.pose.found());
  EXPECT_GT(found.pose.keypoints, 8);
  EXPECT_GT(found.pose.keypoint_error, 0.0);

  const Dataset dataset = Dataset::open(*folder_ / "prepared");
  const Batch batch =
      person_batch(dataset, {dataset.samples(Split::test)[1]}, {dataset.camera_index("1")}, trained.input_size());
  const torch::Tensor dofs = trained.dofs(trained.capture(person_view(batch)));
  const auto [A, T] = trained.deformation(batch.person.select(1, 0));
  const torch::Tensor expected = trained.surface->deformed(dofs, A, T)[0];
  // Prepared images are stored smaller and compressed: nearly the same.
  const torch::Tensor surface = tracker.surface(found.pose.dofs, found.graph);
  EXPECT_LT((surface - expected).norm(2, -1).mean().item<float>(), 0.03f);
}

TEST_F(Deepcap, Rejects) {
  const auto complaint = [](const DeepcapOptions& wrong) {
    const auto filmed = footage();
    return message_of([&] { track_deepcap(*filmed, wrong); });
  };
  const auto all = Footage::open(*folder_ / "capture", 128);
  EXPECT_THAT(message_of<UsageError>([&] { track_deepcap(*all, options("other")); }), HasSubstr("--camera"));
  DeepcapOptions wrong = options("other");
  wrong.out = *folder_ / "capture";
  EXPECT_THAT(complaint(wrong), HasSubstr("the capture itself"));
  wrong = options("other");
  wrong.run = *folder_ / "prepared";
  EXPECT_THAT(complaint(wrong), HasSubstr("not a run"));
}

TEST(TrackFilm, TheSideViewHasAPlainBackground) {
  const TemporaryFolder folder;
  PinholeCamera camera;
  camera.width = camera.height = 64;
  camera.K << 64, 0, 32, 0, 64, 32, 0, 0, 1;
  TriangleMesh triangle;
  triangle.vertices = {{0, 0, 2}, {1, 0, 2}, {0, 1, 2}};
  triangle.faces = {{0, 1, 2}};
  TrackFilm film(folder / "film.mp4", camera, triangle, 25.0);
  film.add(cv::Mat(64, 64, CV_8UC3, cv::Scalar::all(255)), torch::Tensor());
  film.close();
  cv::Mat frame;
  ASSERT_TRUE(cv::VideoCapture((folder / "film.mp4").string()).read(frame));
  ASSERT_EQ(frame.size(), cv::Size(128, 64));
  EXPECT_GT(cv::mean(frame(cv::Rect(8, 8, 48, 48)))[0], 240.0);
  EXPECT_LT(cv::mean(frame(cv::Rect(72, 8, 48, 48)))[0], 80.0);
}

TEST(TrackFilm, TheSideViewStandsAQuarterTurnAway) {
  PinholeCamera camera;
  camera.width = camera.height = 100;
  camera.K << 100, 0, 50, 0, 100, 50, 0, 0, 1;
  camera.R = Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera.t = Eigen::Vector3d(0, 1, 3);
  const Eigen::Vector3d person(0.5, 1.0, 0.2);
  const PinholeCamera side = turned_about(camera, person, M_PI / 2);
  EXPECT_TRUE(side.faults().empty());
  const Eigen::Vector3d before = camera.centre() - person, after = side.centre() - person;
  EXPECT_NEAR(before.norm(), after.norm(), 1e-12);
  EXPECT_NEAR(before.y(), after.y(), 1e-12);
  EXPECT_NEAR(before.x() * after.x() + before.z() * after.z(), 0.0, 1e-12);
  EXPECT_LT((camera.project(person) - side.project(person)).norm(), 1e-9);
}

}  // namespace
}  // namespace doppel::deepcap_test
