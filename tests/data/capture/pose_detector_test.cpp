#include "doppel/data/capture/pose_detector.h"

#include <gmock/gmock.h>

#include <cmath>

#include "data/capture/detector_fixture.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::pose_detector_test {
namespace {

using namespace test_detector;
using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

PointLayout three_points() { return {"three", {"blue", "green", "red"}}; }

/// A black image with a soft spot of one colour.
void add_spot(cv::Mat& image, int channel, double x, double y, double sigma) {
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.cols; ++column) {
      const double d2 = std::pow(column + 0.5 - x, 2) + std::pow(row + 0.5 - y, 2);
      auto& value = image.at<cv::Vec3b>(row, column)[channel];
      value = cv::saturate_cast<std::uint8_t>(value + 240.0 * std::exp(-0.5 * d2 / (sigma * sigma)));
    }
}

class PoseDetection : public ::testing::Test {
 protected:
  PoseDetection() {
    support::write_bytes(folder_ / "net.onnx", onnx_net());
    support::write_bytes(folder_ / "net.caffemodel", caffemodel());
    support::write_bytes(folder_ / "net.prototxt", kPrototxt);
  }
  PersonNetworkOptions options(bool caffe = false) const {
    PersonNetworkOptions result;
    result.network.model = folder_ / (caffe ? "net.prototxt" : "net.onnx");
    if (caffe) result.network.weights = folder_ / "net.caffemodel";
    result.network.input_height = 64;
    return result;
  }
  support::TemporaryFolder folder_;
};

TEST_F(PoseDetection, FindsSpotsBelowTheHeatmapsGrid) {
  for (const bool caffe : {false, true}) {
    PoseDetector detector(options(caffe), three_points());
    for (const double shift : {0.0, 1.7, 3.1, 5.9}) {
      cv::Mat image = cv::Mat::zeros(64, 96, CV_8UC3);
      add_spot(image, 0, 30.0 + shift, 25.5, 9.0);
      add_spot(image, 2, 70.0, 30.0 + shift, 9.0);
      const People people = detector.detect(image);
      ASSERT_EQ(people.size(), 1u);
      const Person& person = people[0];
      ASSERT_EQ(person.size(), 3u);
      EXPECT_NEAR(person[0].x, 30.0 + shift, 0.5) << caffe;
      EXPECT_NEAR(person[0].y, 25.5, 0.5);
      EXPECT_NEAR(person[2].x, 70.0, 0.5);
      EXPECT_NEAR(person[2].y, 30.0 + shift, 0.5);
      EXPECT_GT(person[0].confidence, 0.6f);
      EXPECT_EQ(person[1].confidence, 0.0f) << "nothing is green";
    }
  }
}

TEST_F(PoseDetection, WorksAtItsOwnScale) {
  PoseDetector detector(options(), three_points());
  cv::Mat image = cv::Mat::zeros(192, 288, CV_8UC3);
  add_spot(image, 1, 200.0, 90.0, 27.0);
  const People people = detector.detect(image);
  ASSERT_EQ(people.size(), 1u);
  EXPECT_NEAR(people[0][1].x, 200.0, 1.5);
  EXPECT_NEAR(people[0][1].y, 90.0, 1.5);
}

TEST_F(PoseDetection, SwapsChannelsAndSeesNobody) {
  PersonNetworkOptions swapped = options();
  swapped.network.rgb = true;
  PoseDetector detector(swapped, three_points());
  cv::Mat image = cv::Mat::zeros(64, 96, CV_8UC3);
  EXPECT_TRUE(detector.detect(image).empty());
  add_spot(image, 0, 40.0, 32.0, 9.0);
  EXPECT_EQ(detector.detect(image).at(0)[0].confidence, 0.0f);
  EXPECT_GT(detector.detect(image).at(0)[2].confidence, 0.5f);
}

TEST_F(PoseDetection, RefusesWhatIsNoDetector) {
  const auto refusal = [&](const PersonNetworkOptions& chosen, const PointLayout& layout = three_points()) {
    return message_of<Error>([&] { PoseDetector(chosen, layout).detect(cv::Mat::zeros(64, 96, CV_8UC3)); });
  };
  PersonNetworkOptions wrong = options();
  wrong.network.model = folder_ / "none.onnx";
  EXPECT_THAT(refusal(wrong), AllOf(HasSubstr("none.onnx"), HasSubstr("no such file")));
  wrong.network.model = folder_ / "net.caffemodel";
  EXPECT_THAT(refusal(wrong), HasSubstr(".prototxt"));
  wrong.network.model = folder_ / "net.prototxt";
  EXPECT_THAT(refusal(wrong), HasSubstr("weights"));
  support::write_bytes(folder_ / "bad.onnx", "this is no network at all, but it is long enough to look at");
  wrong.network.model = folder_ / "bad.onnx";
  EXPECT_THAT(refusal(wrong), HasSubstr("cannot read the network"));
  EXPECT_THAT(refusal(options(), {"five", {"a", "b", "c", "d", "e"}}), AllOf(HasSubstr("at least 5"), HasSubstr("4")));
  wrong = options();
  wrong.network.input_height = 2;
  EXPECT_THROW(PoseDetector(wrong, three_points()), UsageError);
}

TEST_F(PoseDetection, SurvivesHostileFiles) {
  const auto look_with = [&](const PersonNetworkOptions& chosen) {
    return [chosen](const std::filesystem::path&) {
      const People people = PoseDetector(chosen, three_points()).detect(cv::Mat(64, 96, CV_8UC3, cv::Scalar::all(90)));
      for (const Person& person : people)
        for (const Keypoint& point : person)
          EXPECT_TRUE(std::isfinite(point.x) && std::isfinite(point.y) && point.confidence <= 1.0f);
    };
  };
  support::expect_survives_hostile_files(folder_ / "net.onnx", onnx_net(), look_with(options()), 20);
  support::expect_survives_hostile_files(folder_ / "net.prototxt", kPrototxt, look_with(options(true)), 20);
  support::write_bytes(folder_ / "net.prototxt", kPrototxt);
  support::expect_survives_hostile_files(folder_ / "net.caffemodel", caffemodel(), look_with(options(true)), 20);
}

}  // namespace
}  // namespace doppel::pose_detector_test
