#include "doppel/eval/cloud_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "doppel/eval/ground_truth.h"
#include "support/message_of.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::cloud_metrics_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;
using torch::Tensor;
namespace fs = std::filesystem;

class CloudMetrics : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    prepared_ = make_small_capture(*folder_ / "capture");
  }
  static void TearDownTestSuite() { delete folder_; }

  CloudMetrics()
      : dataset_(Dataset::open(prepared_)),
        character_(load_character(dataset_.character_path())),
        ground_truth_(dataset_) {
    faces_ = torch::empty({character_.mesh.num_faces(), 3}, torch::kInt32);
    std::copy_n(character_.mesh.faces.data()->data(), faces_.numel(), faces_.data_ptr<int>());
  }
  std::optional<CloudResult> measure(const CloudFunction& cloud, const EvaluationOptions& options = {}) {
    return evaluate_clouds(dataset_, Split::test, faces_, character_.num_vertices(), cloud, options, "cloud");
  }
  /// The true vertices, moved.
  CloudFunction ground_truth_moved(float by) {
    return [this, by](const ImageRequest& request) {
      return ground_truth_.at(request.samples.at(0), character_.num_vertices()) + by;
    };
  }

  static TemporaryFolder* folder_;
  static fs::path prepared_;
  Dataset dataset_;
  Character character_;
  GroundTruth ground_truth_;
  Tensor faces_;
};
TemporaryFolder* CloudMetrics::folder_ = nullptr;
fs::path CloudMetrics::prepared_;

TEST_F(CloudMetrics, TheGroundTruthIsOnItself) {
  const auto result = measure(ground_truth_moved(0.0f));
  ASSERT_TRUE(result);
  EXPECT_LT(result->noise_mm, 1e-3);
  EXPECT_EQ(result->points, character_.num_vertices());
  EXPECT_EQ(result->cameras.size(), 3u);
}

TEST_F(CloudMetrics, PointsOffTheSurfaceCountByTheirDistance) {
  // One point 3 m to the left of everything, one 4 m: their distances differ by 1 m.
  const auto far = [&](const ImageRequest& request) {
    const Tensor vertices = ground_truth_.at(request.samples.at(0), character_.num_vertices());
    const Tensor left = vertices[std::get<1>(vertices.select(1, 0).min(0)).item<std::int64_t>()];
    return torch::stack({left - torch::tensor({3.0f, 0.0f, 0.0f}), left - torch::tensor({4.0f, 0.0f, 0.0f})});
  };
  const auto result = measure(far);
  EXPECT_NEAR(result->surface_distance_mm, 3500.0, 1.0);
  EXPECT_NEAR(result->noise_mm, 1000.0 * std::sqrt(12.5), 1.0);
  EXPECT_NEAR(result->p99_mm, 4000.0, 1.0);
}

TEST_F(CloudMetrics, ChosenFramesAndCameras) {
  EvaluationOptions options;
  options.frames = {2};
  options.cameras = {"c1"};
  std::vector<long> seen;
  const auto result = measure(
      [&](const ImageRequest& request) {
        seen.push_back(request.samples.at(0).frame);
        EXPECT_EQ(request.camera, 1);
        EXPECT_EQ(request.projection.sizes(), at::IntArrayRef({1, 1, 3, 4}));
        return ground_truth_moved(0.0f)(request);
      },
      options);
  EXPECT_EQ(seen, std::vector<long>{2});
  EXPECT_EQ(result->cameras.size(), 1u);
  options.frames = {77};
  EXPECT_THAT(message_of([&] { measure(ground_truth_moved(0.0f), options); }), HasSubstr("frame 77"));
}

TEST_F(CloudMetrics, WithoutAPointThereIsNothingToSay) {
  EXPECT_FALSE(measure([](const ImageRequest&) { return torch::zeros({0, 3}); }));
}

}  // namespace
}  // namespace doppel::cloud_metrics_test
