#include "doppel/eval/silhouette_overlap.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "doppel/character/character.h"
#include "doppel/character/character_folder.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/eval/ground_truth.h"
#include "doppel/eval/hand_boxes.h"
#include "doppel/geometry/mesh.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/outline/seen_vertices.h"
#include "doppel/render/projection.h"
#include "support/message_of.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::silhouette_overlap_test {
namespace {

using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// A filled rectangle in an image of 40 x 30.
std::vector<std::uint8_t> rectangle(int x0, int y0, int x1, int y1, std::uint8_t value) {
  std::vector<std::uint8_t> pixels(40 * 30, 0);
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) pixels[y * 40 + x] = value;
  return pixels;
}

TEST(OverlapReference, TwoRectangles) {
  const auto a = rectangle(5, 5, 15, 15, 255), b = rectangle(10, 10, 20, 20, 1);
  const Overlap o = overlap(a.data(), b.data(), 1200);
  EXPECT_EQ(o.intersection, 25);
  EXPECT_EQ(o.united, 175);
  EXPECT_EQ(o.only_b, 75);
  EXPECT_DOUBLE_EQ(o.iou().value(), 1.0 / 7.0);
}

TEST(OverlapReference, EqualDisjointAndEmpty) {
  const auto a = rectangle(5, 5, 15, 15, 255), b = rectangle(20, 5, 25, 15, 255), none = rectangle(0, 0, 0, 0, 0);
  EXPECT_DOUBLE_EQ(overlap(a.data(), a.data(), 1200).iou().value(), 1.0);
  EXPECT_DOUBLE_EQ(overlap(a.data(), b.data(), 1200).iou().value(), 0.0);
  EXPECT_DOUBLE_EQ(overlap(a.data(), none.data(), 1200).iou().value(), 0.0);
  EXPECT_FALSE(overlap(none.data(), none.data(), 1200).iou());
}

class Capture3 : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    prepared_ = make_small_capture(folder_->path());
  }
  static void TearDownTestSuite() { delete folder_; }

  void SetUp() override {
    dataset_ = std::make_unique<Dataset>(Dataset::open(prepared_));
    character_ = load_character(dataset_->character_path());
    faces_ = face_tensor(character_.mesh);
  }

  torch::Tensor dofs(const std::vector<SampleId>& samples) const {
    std::vector<torch::Tensor> rows;
    for (const SampleId& sample : samples) rows.push_back(dataset_->dof_window(sample, 0)[0]);
    return torch::stack(rows);
  }
  torch::Tensor ground_truth(const std::vector<SampleId>& samples) const {
    std::vector<torch::Tensor> rows;
    for (const SampleId& sample : samples) {
      const Motion& motion = dataset_->sequences()[sample.sequence].motion;
      rows.push_back(small_capture::true_surface(character_, motion, 0.02)[sample.frame]);
    }
    return torch::stack(rows);
  }
  SurfaceResult evaluate(const SurfaceFunction& surface, const EvaluationOptions& options = {},
                         const SurfaceFunction& skinned = {}) const {
    return evaluate_surface(*dataset_, Split::test, character_, surface, options, "test", skinned);
  }

  static TemporaryFolder* folder_;
  static std::filesystem::path prepared_;
  std::unique_ptr<Dataset> dataset_;
  Character character_;
  torch::Tensor faces_;
};
TemporaryFolder* Capture3::folder_ = nullptr;
std::filesystem::path Capture3::prepared_;

using SurfaceOverlapRecovers = Capture3;
using SurfaceOverlapReference = Capture3;
using SurfaceOverlapRejects = Capture3;

TEST_F(SurfaceOverlapReference, ACharacterWithoutHandsHasNoFigureOfThem) {
  EXPECT_FALSE(evaluate([&](const auto& samples) { return ground_truth(samples); }).hand_IoU);
}

TEST_F(SurfaceOverlapRecovers, TheTrueSurfaceFillsItsMasks) {
  // The masks were drawn from it through the same cameras, so only rounding in the files is left.
  const auto result = evaluate([&](const auto& samples) { return ground_truth(samples); });
  EXPECT_GT(result.AMVIoU, 0.999);
  EXPECT_LT(result.vertex_error_mm.value(), 0.01);
  ASSERT_EQ(result.cameras.size(), 3u);
  EXPECT_EQ(result.cameras[1].first, "c1");
}

TEST_F(SurfaceOverlapReference, AShiftOfTheGroundTruthIsTheVertexError) {
  const auto result = evaluate([&](const auto& samples) {
    return ground_truth(samples) + torch::tensor({0.003f, 0.0f, 0.004f});
  });
  EXPECT_NEAR(result.vertex_error_mm.value(), 5.0, 0.01);
  // No point of a surface is farther from the shifted one than the shift; where it looks along the shift it is as far.
  EXPECT_LE(result.Hausdorff_mm.value(), 5.001);
  EXPECT_GT(result.Hausdorff_mm.value(), 3.0);
  EXPECT_LT(result.surface_distance_mm.value(), result.Hausdorff_mm.value());
  EXPECT_GT(result.surface_distance_mm.value(), 1.0);
  EXPECT_LT(result.seen_distance_mm.value(), result.Hausdorff_mm.value());
  EXPECT_GT(result.seen_distance_mm.value(), 1.0);
}

// Vertices that look away from all three cameras are put somewhere else: no scan could tell.
TEST_F(SurfaceOverlapReference, WhatNoCameraSeesCountsOnlyInTheWholeSurface) {
  const torch::Tensor faces = faces_.to(torch::kInt64);
  const auto result = evaluate([&](const std::vector<SampleId>& samples) {
    torch::Tensor surface = ground_truth(samples);
    for (std::int64_t b = 0; b < surface.size(0); ++b) {
      torch::Tensor hidden = torch::ones({surface.size(1)}, torch::kBool);
      for (int c : dataset_->camera_indices({})) {
        const torch::Tensor eye = camera_placement(projection_tensor({dataset_->camera(c)})[0]).centre;
        hidden &= ~seen_vertices(torch::arange(faces.size(0), torch::kInt32), faces, surface[b], eye);
      }
      EXPECT_TRUE(hidden.any().item<bool>());
      surface[b] += 0.05 * hidden.unsqueeze(1);
    }
    return surface;
  });
  EXPECT_LT(result.seen_distance_mm.value(), 0.01);
  EXPECT_GT(result.surface_distance_mm.value(), 0.1);
}

TEST_F(SurfaceOverlapReference, SkinningIsThinnerByTheKnownAmount) {
  CharacterSurface surface(character_);
  const auto result = evaluate([&](const auto& samples) { return surface->skinned(dofs(samples)); });
  EXPECT_NEAR(result.vertex_error_mm.value(), 20.0, 0.1);
  // The tube's radius is about 0.08 m (0.064 the other way), the ground truth 0.02 thicker: the drawn share is about
  // 0.78.
  EXPECT_GT(result.AMVIoU, 0.70);
  EXPECT_LT(result.AMVIoU, 0.85);
  EXPECT_LT(result.outside, 0.01);
  EXPECT_NEAR(result.missing, 1 - result.AMVIoU, 0.02);
}

// The ground truth is the skinned template moved along its normals, so the shape of both is known.
TEST_F(SurfaceOverlapReference, TheTrueSurfaceHasTheTrueShapeAndSkinningNone) {
  CharacterSurface surface(character_);
  const auto skinned = evaluate([&](const auto& samples) { return surface->skinned(dofs(samples)); });
  const auto exact = evaluate([&](const auto& samples) { return ground_truth(samples); });
  const auto half =
      evaluate([&](const auto& samples) { return 0.5 * (ground_truth(samples) + surface->skinned(dofs(samples))); });
  EXPECT_NEAR(exact.normal_error_deg.value(), 0.0, 0.01);
  EXPECT_NEAR(exact.roughness_error_mm.value(), 0.0, 1e-3);
  EXPECT_NEAR(exact.roughness_ratio.value(), 1.0, 1e-3);
  EXPECT_NEAR(exact.border_length_ratio.value_or(1.0), 1.0, 1e-4);
  EXPECT_NEAR(skinned.roughness_ratio.value(), 0.0, 1e-3);
  EXPECT_NEAR(half.roughness_ratio.value(), 0.5, 1e-3);
  EXPECT_GT(skinned.roughness_error_mm.value(), 0.1);
  EXPECT_NEAR(half.roughness_error_mm.value(), 0.5 * skinned.roughness_error_mm.value(), 1e-3);
  for (const char* key : {"normal_error_deg", "roughness_error_mm", "roughness_ratio"})
    EXPECT_TRUE(half.to_json().contains(key)) << key;
}

// Displacements are measured in the pose of the surface, so an error of the pose is no roughness of them.
TEST_F(SurfaceOverlapReference, RoughnessOfASurfaceInAnotherPose) {
  CharacterSurface surface(character_);
  const auto first = [](const std::vector<SampleId>& samples) {
    return std::vector<SampleId>(samples.size(), SampleId{samples[0].sequence, 0});
  };
  const auto still = [&](const std::vector<SampleId>& samples) { return ground_truth(first(samples)); };
  const auto result = evaluate(still, {}, [&](const auto& samples) { return surface->skinned(dofs(first(samples))); });
  EXPECT_GT(result.vertex_error_mm.value(), 10.0);
  EXPECT_NEAR(result.roughness_ratio.value(), 1.0, 0.05);
  EXPECT_GT(std::abs(evaluate(still).roughness_ratio.value() - 1.0), 0.1);
}

/// The capture with a character two of whose markers are the knuckles of hands.
class WithHands : public ::testing::Test {
 protected:
  void SetUp() override {
    prepared_ = make_small_capture(folder_.path());
    character_ = load_character(Dataset::open(prepared_).character_path());
    character_.skeleton.markers[0].name = "left_middle_finger1";
    character_.skeleton.markers[1].name = "right_middle_finger1";
    write_character(folder_ / "character", character_);
    dataset_ = std::make_unique<Dataset>(Dataset::open(prepared_));
  }

  TemporaryFolder folder_;
  std::filesystem::path prepared_;
  Character character_;
  std::unique_ptr<Dataset> dataset_;
};

TEST_F(WithHands, SquaresHaveTheirSizeAndTheKnucklesInTheMiddle) {
  const HandBoxes hands(*dataset_, character_.skeleton);
  ASSERT_TRUE(hands.known());
  const SampleId sample = dataset_->samples(Split::test).front();
  const Motion& motion = dataset_->sequences()[sample.sequence].motion;
  const auto joints = character_.skeleton.pose(motion.frames[sample.frame]);
  const PinholeCamera& camera = dataset_->camera(0);
  const std::vector<cv::Rect> boxes = hands.find(sample, 0);
  ASSERT_EQ(boxes.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    const Marker& marker = character_.skeleton.markers[i];
    const Eigen::Vector3d world = joints[marker.joint] * marker.position;
    const Eigen::Vector2d knuckle = camera.project(world);
    const double side = 0.24 * camera.K(0, 0) / camera.camera_from_world(world).z();
    const cv::Rect whole(cv::Point2d(knuckle.x() - 0.5 * side, knuckle.y() - 0.5 * side), cv::Size2d(side, side));
    const cv::Rect inside = whole & cv::Rect(0, 0, camera.width, camera.height);
    EXPECT_NEAR(boxes[i].x, inside.x, 1.0);
    EXPECT_NEAR(boxes[i].y, inside.y, 1.0);
    EXPECT_NEAR(boxes[i].width, inside.width, 2.0);
    EXPECT_NEAR(boxes[i].height, inside.height, 2.0);
  }
}

TEST_F(WithHands, OnlyTheSquaresCount) {
  const auto true_surface = [&](const std::vector<SampleId>& samples) {
    std::vector<torch::Tensor> rows;
    for (const SampleId& sample : samples)
      rows.push_back(
          small_capture::true_surface(character_, dataset_->sequences()[sample.sequence].motion, 0.02)[sample.frame]);
    return torch::stack(rows);
  };
  EvaluationOptions one;
  one.cameras = {"c0"};
  const auto all = evaluate_surface(*dataset_, Split::test, character_, true_surface, one, "test");
  EXPECT_GT(all.hand_IoU.value(), 0.999);
  EXPECT_TRUE(all.to_json().contains("hand_IoU"));
  // The faces that lie in a square with all corners, in all frames, or that do not.
  const HandBoxes hands(*dataset_, character_.skeleton);
  const std::vector<SampleId> samples = dataset_->samples(Split::test);
  const torch::Tensor vertices = true_surface(samples);
  const auto in_square = [&](const Triangle& face) {
    for (std::size_t b = 0; b < samples.size(); ++b)
      for (const int v : face) {
        const auto* x = vertices[static_cast<std::int64_t>(b)][v].data_ptr<float>();
        const Eigen::Vector2d pixel = dataset_->camera(0).project({x[0], x[1], x[2]});
        bool inside = false;
        for (const cv::Rect& box : hands.find(samples[b], 0))
          inside = inside || box.contains(cv::Point2d(pixel.x(), pixel.y()));
        if (!inside) return false;
      }
    return true;
  };
  Character near = character_, far = character_;
  near.mesh.faces.clear();
  far.mesh.faces.clear();
  for (const Triangle& face : character_.mesh.faces) (in_square(face) ? near : far).mesh.faces.push_back(face);
  ASSERT_FALSE(near.mesh.faces.empty());
  ASSERT_FALSE(far.mesh.faces.empty());
  // Without the faces near the hands, the squares lose more than the whole view; without the others they lose less.
  const auto without_hands = evaluate_surface(*dataset_, Split::test, far, true_surface, one, "test");
  const auto hands_alone = evaluate_surface(*dataset_, Split::test, near, true_surface, one, "test");
  EXPECT_LT(without_hands.hand_IoU.value(), without_hands.AMVIoU);
  EXPECT_GT(hands_alone.hand_IoU.value(), hands_alone.AMVIoU);
}

TEST_F(SurfaceOverlapReference, ChosenCamerasAndFrames) {
  int frames = 0;
  EvaluationOptions options;
  options.cameras = {"c2", "c0"};
  options.every = 2;
  const auto count = [&](const auto& samples) {
    frames += static_cast<int>(samples.size());
    return ground_truth(samples);
  };
  const auto result = evaluate(count, options);
  EXPECT_EQ(frames, 3);  // of 5
  ASSERT_EQ(result.cameras.size(), 2u);
  EXPECT_EQ(result.cameras[0].first, "c2");
  const auto protocol = evaluation_protocol(*dataset_, {Split::test}, options);
  EXPECT_EQ(protocol["frames"]["test"], 3);
  EXPECT_EQ(protocol["cameras"].size(), 2u);
  EXPECT_EQ(protocol["resolution"]["c2"][0], 128);
}

TEST_F(SurfaceOverlapReference, TheInputCameraIsCountedApart) {
  CharacterSurface surface(character_);
  EvaluationOptions options;
  options.input_camera = "c1";
  const auto result = evaluate([&](const auto& samples) { return surface->skinned(dofs(samples)); }, options);
  EXPECT_DOUBLE_EQ(result.SVIoU.value(), result.cameras[1].second);
  EXPECT_DOUBLE_EQ(result.RVIoU.value(), 0.5 * (result.cameras[0].second + result.cameras[2].second));
  EXPECT_DOUBLE_EQ(result.to_json()["SVIoU"], *result.SVIoU);
  options.cameras = {"c1"};
  EXPECT_FALSE(evaluate([&](const auto& samples) { return ground_truth(samples); }, options).RVIoU);
  options.cameras = {"c0", "c2"};
  EXPECT_THAT(support::message_of<UsageError>(
                  [&] { evaluate([&](const auto& samples) { return ground_truth(samples); }, options); }),
              HasSubstr("input camera c1"));
}

// The scans are planes above the person, so the distance of a vertex to its scan is known.
TEST_F(SurfaceOverlapReference, DistanceToScansIsAveragedOverTheirFrames) {
  const TemporaryFolder scans;
  TriangleMesh plane;
  plane.vertices = {{-50, 9, -50}, {50, 9, -50}, {50, 9, 50}, {-50, 9, 50}};
  plane.faces = {{0, 1, 2}, {0, 2, 3}};
  std::filesystem::create_directories(scans / "dance");
  double expected = 0.0;
  for (const long frame : {1L, 4L}) {
    write_obj(scans / "dance" / (std::to_string(frame) + ".obj"), plane, 1.0);
    expected += 500.0 * (9.0 - ground_truth({{1, frame}}).select(2, 1).mean().item<double>());
  }
  EvaluationOptions options;
  options.scans = scans.path();
  options.scan_unit = 1.0;
  const auto result = evaluate([&](const auto& samples) { return ground_truth(samples); }, options);
  EXPECT_NEAR(result.scan_distance_mm.value(), expected, 0.01);
  EXPECT_DOUBLE_EQ(result.to_json()["scan_distance_mm"], *result.scan_distance_mm);
  nlohmann::ordered_json evaluation;
  evaluation["protocol"] = evaluation_protocol(*dataset_, {Split::test}, options);
  evaluation["splits"]["test"]["skinning"] = result.to_json();
  EXPECT_EQ(evaluation["protocol"]["scans"]["frames"]["test"], 2);
  EXPECT_EQ(evaluation["protocol"]["scans"]["metres_per_unit"], 1.0);
  EXPECT_THAT(evaluation_table(evaluation), HasSubstr(fmt::format("off the scan {:.2f} mm", *result.scan_distance_mm)));
}

TEST_F(SurfaceOverlapReference, WithoutScansThereIsNoDistanceToThem) {
  const auto result = evaluate([&](const auto& samples) { return ground_truth(samples); });
  EXPECT_FALSE(result.scan_distance_mm);
  EXPECT_FALSE(result.to_json().contains("scan_distance_mm"));
  EXPECT_FALSE(evaluation_protocol(*dataset_, {Split::test}, {}).contains("scans"));
}

TEST_F(SurfaceOverlapRejects, ScansOfOtherFrames) {
  const TemporaryFolder scans;
  EvaluationOptions options;
  options.scans = scans.path();
  const auto complaint = [&](const std::function<void()>& action) { return support::message_of<UsageError>(action); };
  EXPECT_THAT(complaint([&] { evaluation_protocol(*dataset_, {Split::test}, options); }), HasSubstr("dance/0.obj"));
  EXPECT_THAT(complaint([&] { evaluate([&](const auto& samples) { return ground_truth(samples); }, options); }),
              HasSubstr("none of the 5 evaluated frames"));
}

TEST_F(SurfaceOverlapReference, JsonAndTableSayTheSame) {
  const auto result = evaluate([&](const auto& samples) { return ground_truth(samples); });
  nlohmann::ordered_json evaluation;
  evaluation["protocol"] = evaluation_protocol(*dataset_, {Split::test}, {});
  evaluation["splits"]["test"]["skinning"] = result.to_json();
  EXPECT_DOUBLE_EQ(evaluation["splits"]["test"]["skinning"]["AMVIoU"].get<double>(), result.AMVIoU);
  EXPECT_DOUBLE_EQ(evaluation["splits"]["test"]["skinning"]["cameras"]["c0"].get<double>(), result.cameras[0].second);
  const std::string table = evaluation_table(evaluation);
  EXPECT_THAT(table, HasSubstr("test split, 5 frames, 3 cameras"));
  EXPECT_THAT(table, HasSubstr(fmt::format("AMVIoU {:.4f}", result.AMVIoU)));
}

TEST_F(SurfaceOverlapRejects, UnknownCamera) {
  EvaluationOptions options;
  options.cameras = {"c9"};
  EXPECT_THROW(evaluate([&](const auto& samples) { return ground_truth(samples); }, options), UsageError);
}

TEST_F(SurfaceOverlapRejects, SplitsAndFramesThatAreNotThere) {
  EXPECT_THAT(support::message_of<UsageError>([&] { evaluated_samples(*dataset_, Split::validation, {}); }),
              AllOf(HasSubstr("--split validation"), HasSubstr("it has train, test")));
  EXPECT_THROW(evaluation_protocol(*dataset_, {Split::validation}, {}), UsageError);
  EvaluationOptions options;
  options.frames = {0, 99};
  EXPECT_THAT(support::message_of<UsageError>([&] {
                evaluation_protocol(*dataset_, {Split::train, Split::test}, options);
              }),
              AllOf(HasSubstr("train, test"), HasSubstr("frame 99")));
  options.frames = {99};
  EXPECT_THROW(evaluated_samples(*dataset_, Split::test, options), UsageError);
}

TEST_F(SurfaceOverlapReference, AFrameMayBeOfOneSplitAlone) {
  EvaluationOptions options;
  options.frames = {2, 8};  // dance has 5 frames
  const auto protocol = evaluation_protocol(*dataset_, {Split::train, Split::test}, options);
  EXPECT_EQ(protocol["frames"]["train"], 2);
  EXPECT_EQ(protocol["frames"]["test"], 1);
  EXPECT_THROW(evaluation_protocol(*dataset_, {Split::test}, options), UsageError);
}

TEST_F(SurfaceOverlapReference, WithoutGroundTruthItsFiguresAreLeftOut) {
  const auto surface = [&](const auto& samples) { return ground_truth(samples); };
  EvaluationOptions options;
  options.frames = {1};
  options.ground_truth = false;
  const SurfaceResult result = evaluate(surface, options);
  EXPECT_GT(result.AMVIoU, 0.999);
  for (const char* figure : {"vertex_error_mm", "Hausdorff_mm", "surface_distance_mm", "normal_error_deg"})
    EXPECT_FALSE(result.to_json().contains(figure)) << figure;
}

TEST_F(SurfaceOverlapReference, GroundTruthOfAnotherCharacterIsNamed) {
  const int vertices = character_.num_vertices();
  EXPECT_EQ(ground_truth_of_another_character(*dataset_, {Split::train, Split::test}, vertices), "");
  EXPECT_THAT(ground_truth_of_another_character(*dataset_, {Split::test}, 7),
              AllOf(HasSubstr("dance/vertices.npy"), HasSubstr(fmt::format("surfaces of {} vertices", vertices)),
                    HasSubstr("the character has 7")));
  EXPECT_EQ(ground_truth_of_another_character(*dataset_, {Split::validation}, 7), "");
}

TEST_F(SurfaceOverlapReference, AFigureThatIsNoNumberIsADash) {
  nlohmann::ordered_json evaluation;
  evaluation["protocol"] = evaluation_protocol(*dataset_, {Split::test}, {});
  evaluation["splits"]["test"]["pose"] = {{"AMVIoU", nullptr},
                                          {"MPJPE_mm", std::numeric_limits<double>::infinity()},
                                          {"outside", 0.25},
                                          {"filmed", {{"MSE", 12.0}}},
                                          {"cameras", {{"c0", 0.5}}}};
  EXPECT_THAT(evaluation_table(evaluation), AllOf(HasSubstr("AMVIoU -"), HasSubstr("MPJPE - mm"),
                                                  HasSubstr("outside 25.00 %"), HasSubstr("as filmed 12.00")));
}

TEST_F(SurfaceOverlapRejects, GroundTruthOfAnotherCharacter) {
  const auto path = dataset_->capture().resolve("ground_truth/dance/vertices.npy");
  const std::string before = read_file(path);
  const std::vector<float> few(5 * 7 * 3, 0.0f);
  write_npy(path, few.data(), {5, 7, 3});
  try {
    evaluate([&](const auto& samples) { return ground_truth(samples); });
    ADD_FAILURE() << "accepted";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("[5,7,3]"));
  }
  write_atomically(path, before);
}

}  // namespace
}  // namespace doppel::silhouette_overlap_test
