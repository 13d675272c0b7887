#include "doppel/eval/tracked_evaluation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/data/capture/capture.h"
#include "support/message_of.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::tracked_evaluation_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using torch::Tensor;

/// A prepared capture, and folders like those of `doppel track` beside it.
class TrackedEvaluationTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    SmallCaptureOptions small;
    small.test_frames = 8;
    dataset_ = new Dataset(Dataset::open(make_small_capture(*folder_ / "capture", small)));
    character_ = new Character(load_character(dataset_->character_path()));
  }
  static void TearDownTestSuite() {
    delete character_;
    delete dataset_;
    delete folder_;
  }

  static const DatasetSequence& sequence() { return dataset_->sequences()[1]; }  // dance, the test split
  /// Tracked motion and surfaces: the true ones, moved along x by `shift` metres and, in odd frames, by `jitter` more.
  static fs::path tracked(const std::string& name, double shift, double jitter = 0.0, long first_frame = 0) {
    const fs::path out = *folder_ / name;
    fs::create_directories(out);
    Motion motion = sequence().motion;
    const auto root = character_->skeleton.root();
    const Tensor ground_truth = true_vertices();
    std::vector<float> vertices;
    for (long f = 0; f < motion.num_frames(); ++f) {
      const double moved = shift + (f % 2 == 1 ? jitter : 0.0);
      motion.frames[f][root.translation[0]] += moved / root.translation_weight[0];
      const Tensor surface = ground_truth[f] + torch::tensor({static_cast<float>(moved), 0.0f, 0.0f});
      if (f >= first_frame)
        vertices.insert(vertices.end(), surface.data_ptr<float>(), surface.data_ptr<float>() + surface.numel());
    }
    write_motion(out / "dance.motion", motion, true);
    write_npy(out / "dance_vertices.npy", vertices.data(),
              {ground_truth.size(0) - first_frame, ground_truth.size(1), 3});
    Capture capture = dataset_->capture();
    capture.sequences.erase(capture.sequences.begin());
    capture.sequences[0].motion = (out / "dance.motion").string();
    capture.sequences[0].first_frame = first_frame;
    write_capture(out / "capture.yaml", capture);
    return out;
  }
  static Tensor true_vertices() {
    const NpyArray array = read_npy(dataset_->capture().resolve("ground_truth/dance/vertices.npy"));
    return torch::tensor(array.as<float>()).view({array.shape[0], array.shape[1], 3});
  }
  static nlohmann::ordered_json evaluate(const fs::path& folder, const TrackedEvaluationOptions& options = {}) {
    return evaluate_tracked(*dataset_, *character_, TrackedRun::load(folder, *character_), Split::test, options);
  }

  static TemporaryFolder* folder_;
  static Dataset* dataset_;
  static Character* character_;
};
TemporaryFolder* TrackedEvaluationTest::folder_ = nullptr;
Dataset* TrackedEvaluationTest::dataset_ = nullptr;
Character* TrackedEvaluationTest::character_ = nullptr;

TEST_F(TrackedEvaluationTest, MeasuresThePoseAndTheSurfaceApart) {
  const auto rows = evaluate(tracked("true", 0.0));
  EXPECT_LT(rows["surface"]["vertex_error_mm"].get<double>(), 1e-3);
  EXPECT_GT(rows["surface"]["AMVIoU"].get<double>(), 0.97);
  EXPECT_GT(rows["pose"]["vertex_error_mm"].get<double>(), 5.0) << "the true surface is thicker than the template";
  EXPECT_LT(rows["pose"]["AMVIoU"].get<double>(), rows["surface"]["AMVIoU"].get<double>());
  EXPECT_NEAR(rows["surface"]["roughness_ratio"].get<double>(), 1.0, 1e-3);
  EXPECT_NEAR(rows["pose"]["roughness_ratio"].get<double>(), 0.0, 1e-6);
}

TEST_F(TrackedEvaluationTest, OneCameraIsComparedAtTheTruePosition) {
  const fs::path moved = tracked("moved", 0.3);
  EXPECT_NEAR(evaluate(moved)["surface"]["vertex_error_mm"].get<double>(), 300.0, 0.1);
  TrackedEvaluationOptions options;
  options.input_camera = dataset_->cameras()[1].name;
  const auto rows = evaluate(moved, options);
  EXPECT_LT(rows["surface"]["vertex_error_mm"].get<double>(), 0.1);
  EXPECT_TRUE(rows["surface"].contains("SVIoU"));
}

TEST_F(TrackedEvaluationTest, SmoothingAveragesFiveFrames) {
  const fs::path folder = tracked("jitter", 0.0, 0.1);
  TrackedEvaluationOptions options;
  options.frames = {4};  // an even frame: the weights of its odd neighbours move it
  EXPECT_LT(evaluate(folder, options)["surface"]["vertex_error_mm"].get<double>(), 1e-3);
  options.smoothing = 1.0;
  const double one = std::exp(-0.5), two = std::exp(-2.0), share = 2.0 * one / (1.0 + 2.0 * one + 2.0 * two);
  const Tensor ground_truth = true_vertices();
  Tensor mean = torch::zeros_like(ground_truth[0]);
  const double weights[] = {two, one, 1.0, one, two};
  for (int i = 0; i < 5; ++i) mean += ground_truth[2 + i] * (weights[i] / (1.0 + 2.0 * one + 2.0 * two));
  mean.select(1, 0) += 0.1 * share;
  const double expected = 1e3 * (mean - ground_truth[4]).norm(2, 1).mean().item<double>();
  EXPECT_NEAR(evaluate(folder, options)["surface"]["vertex_error_mm"].get<double>(), expected, 1e-2);
}

TEST_F(TrackedEvaluationTest, RowsOfTheSurfaceFileBeginAtTheFirstTrackedFrame) {
  const fs::path folder = tracked("late", 0.0, 0.0, 3);
  TrackedEvaluationOptions options;
  options.frames = {3, 5};
  EXPECT_LT(evaluate(folder, options)["surface"]["vertex_error_mm"].get<double>(), 1e-3);
  EXPECT_THAT(message_of<UsageError>([&] { evaluate(folder); }),
              HasSubstr("frame 0 of sequence dance was not tracked"));
}

TEST_F(TrackedEvaluationTest, RejectsOtherFolders) {
  EXPECT_THAT(message_of<UsageError>([&] { TrackedRun::load(*folder_ / "nowhere", *character_); }),
              HasSubstr("output folder of `doppel track`"));
  const fs::path folder = tracked("other", 0.0);
  const std::vector<float> wrong(3 * 4 * 3, 0.0f);
  write_npy(folder / "dance_vertices.npy", wrong.data(), {3, 4, 3});
  EXPECT_THAT(message_of([&] { TrackedRun::load(folder, *character_); }),
              HasSubstr("for this character, found [3,4,3]"));
}

TEST_F(TrackedEvaluationTest, RejectsVerticesThatAreNotFinite) {
  const fs::path folder = tracked("broken", 0.0);
  NpyArray array = read_npy(folder / "dance_vertices.npy");
  std::vector<float> values = array.as<float>();
  values[3 * static_cast<std::size_t>(character_->num_vertices()) * 3 + 4] = std::nanf("");
  write_npy(folder / "dance_vertices.npy", values.data(), array.shape);
  EXPECT_THAT(message_of([&] { TrackedRun::load(folder, *character_); }),
              AllOf(HasSubstr("dance_vertices.npy: row 3"), HasSubstr("not finite; 1 of 8 rows")));
}

TEST_F(TrackedEvaluationTest, RejectsMotionsThatAreNotFinite) {
  const fs::path folder = tracked("broken motion", 0.0);
  Motion motion = sequence().motion;
  motion.frames[2][4] = 12345678.5;
  write_motion(folder / "dance.motion", motion, true);  // which writes no NaN itself
  std::string text = read_file(folder / "dance.motion");
  text.replace(text.find("12345678.5"), 10, "nan");
  write_atomically(folder / "dance.motion", text);
  EXPECT_THAT(message_of([&] { TrackedRun::load(folder, *character_); }), HasSubstr("dance.motion:4"));
}

TEST_F(TrackedEvaluationTest, KnowsTheCaptureThatWasTracked) {
  const TrackedRun run = TrackedRun::load(tracked("same", 0.0), *character_);
  EXPECT_EQ(run.other_capture(dataset_->capture()), "");
  Capture other = dataset_->capture();
  other.name = "berta";
  EXPECT_THAT(run.other_capture(other), AllOf(HasSubstr("tube in "), HasSubstr("berta")));
  other = dataset_->capture();
  other.root = "/nowhere/berta";
  EXPECT_THAT(run.other_capture(other), HasSubstr("/nowhere/berta"));
}

TEST_F(TrackedEvaluationTest, ErrorMapsAreRefusedBeforeAnythingIsMeasured) {
  const fs::path folder = tracked("poses alone", 0.0);
  fs::remove(folder / "dance_vertices.npy");
  TrackedEvaluationOptions options;
  options.error_maps = *folder_ / "maps";
  const TrackedRun run = TrackedRun::load(folder, *character_);
  EXPECT_THAT(message_of<UsageError>([&] { check_tracked(*dataset_, run, Split::test, options); }),
              HasSubstr("--error-maps needs the true surface of dance"));
  EXPECT_FALSE(fs::exists(options.error_maps));
  options.error_maps.clear();
  EXPECT_NO_THROW(check_tracked(*dataset_, run, Split::test, options));

  const TrackedRun whole = TrackedRun::load(tracked("with vertices", 0.0), *character_);
  options.error_maps = *folder_ / "maps";
  options.ground_truth = false;
  EXPECT_THROW(check_tracked(*dataset_, whole, Split::test, options), UsageError);
  options.ground_truth = true;
  EXPECT_NO_THROW(check_tracked(*dataset_, whole, Split::test, options));
}

}  // namespace
}  // namespace doppel::tracked_evaluation_test
