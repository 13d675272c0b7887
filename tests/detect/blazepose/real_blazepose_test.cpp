#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/detect/blazepose/body_detector.h"
#include "doppel/detect/blazepose/network.h"
#include "doppel/detect/blazepose/tflite_model.h"
#include "support/blazepose_weights.h"

namespace doppel::real_blazepose_test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr BlazePoseModel kModels[] = {BlazePoseModel::lite, BlazePoseModel::full, BlazePoseModel::heavy};

class RealBlazePose : public support::BlazePoseTest {
 protected:
  fs::path folder() const { return shared_ / "oracle" / "blazepose"; }

  std::vector<Json> results() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder() / "results")) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    std::vector<Json> all;
    for (const fs::path& file : files) all.push_back(Json::parse(std::ifstream(file)));
    return all;
  }

  cv::Mat image_of(const Json& result) const {
    return cv::imread((folder() / result["picture"].get<std::string>()).string(), cv::IMREAD_COLOR);
  }

  std::vector<float> vector_of(const std::string& name) const {
    return read_npy(folder() / "vectors" / (name + ".npy")).as<float>();
  }
};

double largest_difference(std::span<const float> found, const std::vector<float>& expected) {
  EXPECT_EQ(found.size(), expected.size());
  double largest = 0;
  for (std::size_t i = 0; i < std::min(found.size(), expected.size()); ++i)
    largest = std::max(largest, std::abs(static_cast<double>(found[i]) - expected[i]));
  return largest;
}

double largest_probability_difference(std::span<const float> logits, const std::vector<float>& expected) {
  const auto sigmoid = [](double x) { return 1 / (1 + std::exp(-x)); };
  double largest = 0;
  for (std::size_t i = 0; i < logits.size(); ++i)
    largest = std::max(largest, std::abs(sigmoid(logits[i]) - sigmoid(expected.at(i))));
  return largest;
}

/// The formula of the oracle's synthetic input.
void fill_with_sines(std::span<float> input, int side, double scale, double offset) {
  for (int y = 0, i = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      for (int c = 0; c < 3; ++c, ++i)
        input[static_cast<std::size_t>(i)] =
            static_cast<float>(scale * (0.5 + 0.5 * std::sin(0.05 * x * (c + 1) + 0.083 * y + 0.7 * c)) + offset);
}

/// The tolerances are those that TensorFlow Lite and an independent float32 implementation reach; twice that for
/// landmarks, heat maps, joints and scores, whose sums are rounded in another order by each instruction set.
class RealBlazePoseNetworks : public RealBlazePose {
 protected:
  void check_landmarks(Network& network, const std::string& prefix) const {
    network.run();
    EXPECT_LT(largest_difference(network.output(0), vector_of(prefix + "_landmarks")), 1e-2) << prefix;
    EXPECT_LT(largest_difference(network.output(1), vector_of(prefix + "_presence")), 3e-5) << prefix;
    EXPECT_LT(largest_probability_difference(network.output(2), vector_of(prefix + "_segmentation_logits")), 2e-3)
        << prefix;
    EXPECT_LT(largest_difference(network.output(3), vector_of(prefix + "_heatmap_logits")), 2e-3) << prefix;
    EXPECT_LT(largest_difference(network.output(4), vector_of(prefix + "_world")), 6e-5) << prefix;
  }

  void check_detector(Network& network, const std::string& prefix) const {
    network.run();
    EXPECT_LT(largest_difference(network.output(0), vector_of(prefix + "_boxes")), 2e-3) << prefix;
    EXPECT_LT(largest_difference(network.output(1), vector_of(prefix + "_scores")), 1.2e-3) << prefix;
  }
};

TEST_F(RealBlazePoseNetworks, LandmarkOutputsAgreeWithTensorFlowLite) {
  for (const BlazePoseModel model : kModels) {
    Network network(read_tflite(find_model(landmark_file(model))), 1);
    fill_with_sines(network.input(), kRoiPixels, 1, 0);
    check_landmarks(network, "sine_" + to_string(model));
    const std::vector<float> input = vector_of("real_cam01_f030_landmark_input");
    std::copy(input.begin(), input.end(), network.input().begin());
    check_landmarks(network, "real_cam01_f030_" + to_string(model));
  }
}

TEST_F(RealBlazePoseNetworks, DetectorOutputsAgreeWithTensorFlowLite) {
  Network network(read_tflite(find_model(kDetectorFile)), 1);
  fill_with_sines(network.input(), kDetectorPixels, 2, -1);
  check_detector(network, "sine_detector");
  const std::vector<float> input = vector_of("real_cam01_f030_detector_input");
  std::copy(input.begin(), input.end(), network.input().begin());
  check_detector(network, "real_cam01_f030_detector");
}

TEST_F(RealBlazePoseNetworks, TheNumberOfThreadsDoesNotChangeTheResult) {
  const NetworkModel model = read_tflite(find_model(landmark_file(BlazePoseModel::lite)));
  Network one(model, 1), three(model, 3);
  for (Network* network : {&one, &three}) {
    fill_with_sines(network->input(), kRoiPixels, 1, 0);
    network->run();
  }
  for (std::size_t i = 0; i < model.outputs.size(); ++i)
    EXPECT_TRUE(std::equal(one.output(i).begin(), one.output(i).end(), three.output(i).begin())) << "output " << i;
}

Eigen::Vector2d pixel_of(const Json& point, const Json& result) {
  return {point[0].get<double>() * result["width"].get<double>(),
          point[1].get<double>() * result["height"].get<double>()};
}

BodyRoi roi_of(const Json& roi, const Json& result) {
  return {{roi["x_center"].get<double>() * result["width"].get<double>(),
           roi["y_center"].get<double>() * result["height"].get<double>()},
          roi["width"].get<double>() * result["width"].get<double>(),
          roi["rotation"].get<double>()};
}

/// Largest and all differences of one quantity.
struct Differences {
  std::vector<double> values;
  void add(double value) { values.push_back(std::abs(value)); }
  double largest() const { return *std::max_element(values.begin(), values.end()); }
  double ratio_above(double limit) const {
    return static_cast<double>(std::count_if(values.begin(), values.end(), [&](double v) { return v > limit; })) /
           static_cast<double>(values.size());
  }
  double median() const {
    std::vector<double> sorted = values;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    return sorted[sorted.size() / 2];
  }
  std::string text() const { return fmt::format("median {:.3g}, largest {:.3g}", median(), largest()); }
};

struct PoseDifferences {
  Differences pixels, depth, visibility, world, next_centre, next_side, next_rotation, mask_mean, mask_largest,
      mask_iou;

  void add_points(const BodyPose& pose, const Json& expected, const Json& result) {
    for (std::size_t i = 0; i < 33; ++i) {
      const Json &point = expected["landmarks"][i], &metres = expected["world_landmarks"][i];
      const BodyLandmark& found = pose.landmarks[i];
      pixels.add((Eigen::Vector2d(found.x, found.y) - pixel_of(point, result)).norm());
      depth.add(found.z - point[2].get<double>() * result["width"].get<double>());
      visibility.add(found.visibility - point[3].get<double>());
      const Eigen::Vector3d there(metres[0].get<double>(), metres[1].get<double>(), metres[2].get<double>());
      world.add((pose.world[i] - there).norm());
    }
    const BodyRoi next = roi_of(expected["roi_from_landmarks"], result);
    next_centre.add((pose.next_roi.centre - next.centre).norm());
    next_side.add(pose.next_roi.side - next.side);
    next_rotation.add(std::remainder(pose.next_roi.rotation - next.rotation, 2 * std::numbers::pi));
  }

  void add_mask(const cv::Mat& found, const cv::Mat& expected) {
    ASSERT_EQ(found.size(), expected.size());
    cv::Mat difference;
    cv::absdiff(found, expected, difference);
    double most = 0;
    cv::minMaxLoc(difference, nullptr, &most);
    mask_mean.add(cv::mean(difference)[0] / 255);
    mask_largest.add(most / 255);
    const cv::Mat a = found > 127, b = expected > 127;
    mask_iou.add(static_cast<double>(cv::countNonZero(a & b)) / cv::countNonZero(a | b));
  }
};

/// Poses of all images and networks. `with_roi`: in the oracle's region, otherwise the whole chain.
class RealBlazePoseChain : public RealBlazePose {
 protected:
  PoseDifferences compare(bool with_roi) const {
    PoseDifferences all;
    for (const BlazePoseModel model : kModels) {
      BodyDetector detector({.model = model});
      for (const Json& result : results()) {
        if (!result["pose_found"].get<bool>()) continue;
        const cv::Mat image = image_of(result);
        const auto pose = with_roi ? detector.read_pose(image, roi_of(result["roi"], result)) : detector.detect(image);
        EXPECT_TRUE(pose) << result["picture"];
        if (!pose) continue;
        const Json& expected = result[to_string(model)];
        all.add_points(*pose, expected, result);
        all.add_mask(pose->mask,
                     cv::imread((folder() / expected["mask"].get<std::string>()).string(), cv::IMREAD_GRAYSCALE));
      }
    }
    return all;
  }

  void check(const PoseDifferences& found, const char* title) const {
    fmt::print("{}: pixels {}; above 0.02 px {:.2f} %\n  depth px {}\n  visibility {}\n  world m {}\n", title,
               found.pixels.text(), 100 * found.pixels.ratio_above(0.02), found.depth.text(), found.visibility.text(),
               found.world.text());
    fmt::print("  next region: centre px {}, side px {}, rotation {}\n", found.next_centre.text(),
               found.next_side.text(), found.next_rotation.text());
    const auto& iou = found.mask_iou.values;
    fmt::print("  mask: mean {}, largest {}, smallest IoU {:.5f}\n", found.mask_mean.text(), found.mask_largest.text(),
               *std::min_element(iou.begin(), iou.end()));
    EXPECT_LE(found.pixels.ratio_above(0.02), 0.01);
    EXPECT_LT(found.pixels.median(), 0.002);
    EXPECT_LT(found.depth.largest(), 0.3);
    EXPECT_LT(found.visibility.largest(), 1e-3);
    EXPECT_LT(found.world.largest(), 1e-3);
    EXPECT_LT(found.next_centre.median(), 0.002);
    EXPECT_LT(found.next_side.median(), 0.005);
    EXPECT_LT(found.next_rotation.median(), 1e-4);
    EXPECT_LT(found.mask_mean.largest(), 1e-4);
    EXPECT_GE(*std::min_element(iou.begin(), iou.end()), 0.9995);
  }
};

TEST_F(RealBlazePoseChain, BoxesAgree) {
  BodyDetector detector({.model = BlazePoseModel::lite});
  Differences score, corner, keypoints, side, rotation;
  for (const Json& result : results()) {
    const std::vector<BodyBox> boxes = detector.find_boxes(image_of(result));
    if (!result["pose_found"].get<bool>()) {
      EXPECT_TRUE(boxes.empty()) << result["picture"];
      continue;
    }
    ASSERT_FALSE(boxes.empty()) << result["picture"];
    const Json& expected = result["detection"];
    const Json& box = expected["box"];
    score.add(boxes[0].score - expected["score"].get<double>());
    corner.add((boxes[0].corner - pixel_of({box["xmin"], box["ymin"]}, result)).norm());
    corner.add((boxes[0].size - pixel_of({box["width"], box["height"]}, result)).norm());
    for (std::size_t k = 0; k < 4; ++k)
      keypoints.add((boxes[0].keypoints[k] - pixel_of(expected["keypoints"][k], result)).norm());
    const BodyRoi found = roi_of_box(boxes[0]), there = roi_of(result["roi"], result);
    side.add(found.side - there.side);
    rotation.add(std::remainder(found.rotation - there.rotation, 2 * std::numbers::pi));
  }
  fmt::print("boxes: score {}; corner and size px {}; keypoints px {}; region: side px {}, rotation {}\n", score.text(),
             corner.text(), keypoints.text(), side.text(), rotation.text());
  EXPECT_LT(score.largest(), 1e-4);
  EXPECT_LT(corner.largest(), 0.01);
  EXPECT_LT(keypoints.largest(), 0.01);
  EXPECT_LT(side.largest(), 0.02);
  EXPECT_LT(rotation.largest(), 1e-4);
}

TEST_F(RealBlazePoseChain, PosesAgree) { check(compare(false), "whole chain"); }

TEST_F(RealBlazePoseChain, PosesInTheOraclesRegionAgree) { check(compare(true), "in the oracle's region"); }

TEST_F(RealBlazePoseChain, NobodyIsFoundInAnEmptyScene) {
  for (const BlazePoseModel model : kModels) {
    BodyDetector detector({.model = model});
    int empty_scenes = 0;
    for (const Json& result : results()) {
      if (result["pose_found"].get<bool>()) continue;
      ++empty_scenes;
      EXPECT_FALSE(detector.detect(image_of(result))) << result["picture"];
    }
    EXPECT_GT(empty_scenes, 0);
  }
}

TEST_F(RealBlazePoseChain, OddImagesAreSearchedOrRefused) {
  BodyDetector detector({.model = BlazePoseModel::lite});
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 3000), cv::Size(9000, 2), cv::Size(6000, 5000)}) {
    for (const int grey : {0, 128, 255}) {
      const cv::Mat image(size, CV_8UC3, cv::Scalar::all(grey));
      EXPECT_TRUE(detector.detect_all(image).empty()) << size.width << "x" << size.height;
      for (const double side : {1.0, 1e5}) detector.read_pose(image, {{0.5, 0.5}, side, 1});
    }
  }
  const cv::Mat colour(40, 40, CV_8UC3, cv::Scalar::all(9));
  EXPECT_FALSE(detector.read_pose(colour, {{0, 0}, 0, 0}));
  EXPECT_FALSE(detector.read_pose(colour, {{std::nan(""), 0}, 5, 0}));
  for (const int type : {CV_8UC1, CV_8UC4, CV_16UC3, CV_32FC3})
    EXPECT_THROW(detector.detect(cv::Mat(40, 40, type, cv::Scalar::all(0))), UsageError) << type;
  EXPECT_THROW(detector.detect(cv::Mat()), UsageError);
}

TEST_F(RealBlazePoseChain, MasksAreMadeOnlyWhenAskedFor) {
  BodyDetector detector({.model = BlazePoseModel::lite, .masks = false});
  const Json result = results().at(0);
  const auto pose = detector.detect(image_of(result));
  ASSERT_TRUE(pose);
  EXPECT_TRUE(pose->mask.empty());
}

/// The image with two people: each can be followed.
class RealBlazePoseTracker : public RealBlazePose {
 protected:
  cv::Mat pair() const { return cv::imread((folder() / "pictures" / "realx_pair_a.png").string()); }
  static Eigen::Vector2d hips(const BodyPose& pose) {
    const BodyLandmark &left = pose.landmarks[23], &right = pose.landmarks[24];
    return {0.5 * (left.x + right.x), 0.5 * (left.y + right.y)};
  }
  BodyDetector detector_{{.model = BlazePoseModel::lite}};
};

TEST_F(RealBlazePoseTracker, FindsBothPeople) {
  const cv::Mat image = pair();
  const std::vector<BodyPose> people = detector_.detect_all(image);
  ASSERT_EQ(people.size(), 2u);
  EXPECT_NE(hips(people[0]).x() < image.cols / 2.0, hips(people[1]).x() < image.cols / 2.0);
}

TEST_F(RealBlazePoseTracker, FollowsThePersonNearestToTheHint) {
  const cv::Mat image = pair();
  for (const BodyPose& person : detector_.detect_all(image)) {
    BodyTracker tracker(detector_, hips(person) + Eigen::Vector2d(15, -10));
    for (int frame = 0; frame < 5; ++frame) {
      const auto pose = tracker.track(image);
      ASSERT_TRUE(pose);
      EXPECT_LT((hips(*pose) - hips(person)).norm(), 15) << "frame " << frame;
    }
  }
}

TEST_F(RealBlazePoseTracker, FindsThePersonAgain) {
  const cv::Mat image = pair();
  const cv::Mat empty(image.size(), CV_8UC3, cv::Scalar::all(90));
  const std::vector<BodyPose> people = detector_.detect_all(image);
  ASSERT_EQ(people.size(), 2u);
  BodyTracker tracker(detector_, hips(people[1]));
  ASSERT_TRUE(tracker.track(image));
  EXPECT_FALSE(tracker.track(empty));
  EXPECT_FALSE(tracker.track(empty));
  const auto again = tracker.track(image);
  ASSERT_TRUE(again);
  EXPECT_LT((hips(*again) - hips(people[1])).norm(), 15) << "the second best, because the tracker followed it";
}

TEST_F(RealBlazePoseTracker, StartsWithTheBestBoxAndLooksAroundItsLandmarks) {
  const cv::Mat image = pair();
  const auto first = detector_.detect(image);
  ASSERT_TRUE(first);
  BodyTracker tracker(detector_);
  EXPECT_EQ(tracker.track(image)->roi.centre, first->roi.centre);
  EXPECT_EQ(tracker.track(image)->roi.centre, first->next_roi.centre);
}

}  // namespace
}  // namespace doppel::real_blazepose_test
