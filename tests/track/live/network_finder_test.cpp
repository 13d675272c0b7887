#include "doppel/track/live/network_finder.h"

#include <gmock/gmock.h>

#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/onnx_file.h"
#include "track/live/live_fixture.h"

namespace doppel::network_finder_test {
namespace {

using support::message_of;
using support::OnnxFile;
using ::testing::HasSubstr;

/// At every `stride`th pixel: the brightness of red, times a factor, and a constant. The tube is red, the wall is not.
std::string red_net(int stride, float factor, float constant) {
  OnnxFile net;
  const int size = (192 - 1) / stride + 1;
  net.input("image", {1, 3, 192, 192}).output("red", {1, 1, size, size});
  net.floats("w", {1, 3, 1, 1}, {0, 0, factor}).floats("b", {1}, {constant});
  net.node("Conv", {"image", "w", "b"}, {"red"},
           {OnnxFile::ints("kernel_shape", {1, 1}), OnnxFile::ints("strides", {stride, stride})});
  return net.bytes();
}

/// A detector with one point, the first red pixel, on which all landmarks are, and a network for masks.
class LiveNetwork : public LiveCapture {
 protected:
  LiveNetwork() {
    support::write_bytes(root() / "point.onnx", red_net(4, 1.0f, 0.0f));
    support::write_bytes(root() / "mask.onnx", red_net(1, 40.0f, -24.0f));
    std::string map = "points: [red]\nlandmarks:\n";
    for (const Marker& landmark : landmarks_) map += "  " + landmark.name + ": red\n";
    support::write_bytes(root() / "map.yaml", map);
    write(", mask: {model: mask.onnx, input: [192, 192]}");
  }
  void write(const std::string& mask) const {
    std::ofstream(root() / "network.yaml")
        << "doppel_capture: 1\nname: tube\ncharacter: " << std::filesystem::relative(character_file_, root()).string()
        << "\ncalibration: cameras.yml\nlandmarks: landmarks.csv\nkeypoint_map: map.yaml\n"
        << "detector: {model: point.onnx, output: heatmaps, refine: none, input: [192, 192]" << mask << "}\n"
        << "sequences:\n  - {name: walk, split: test, videos: 'film/{frame:03}.png'}\n";
  }
};

TEST_F(LiveNetwork, MasksAndKeypointsComeFromTheImages) {
  LiveView seen = view("network.yaml");
  for (const int frame : {0, 4}) {
    const SourceImage source{frame, frame, image(frame), Clock::now()};
    FootageFrame found = seen.preprocess(source);
    seen.detect(source, found);
    const cv::Mat ground_truth = mask_of(model_, cameras_[1], this->ground_truth(frame));
    const cv::Mat both = found.masks.at(0) & ground_truth, any = found.masks[0] | ground_truth;
    EXPECT_GT(cv::countNonZero(both), 0.98 * cv::countNonZero(any)) << frame;
    EXPECT_FALSE(found.evidence.at(0).outline.empty());
    ASSERT_EQ(found.evidence[0].keypoints.size(), landmarks_.size());
    for (const Keypoint& point : found.evidence[0].keypoints) {
      EXPECT_GT(point.confidence, 0.9f);
      EXPECT_GT(ground_truth.at<std::uint8_t>(static_cast<int>(point.y), static_cast<int>(point.x)), 0);
    }
  }
}

TEST_F(LiveNetwork, AnEmptySceneThatWasLearntComesFirst) {
  LiveView seen = view("network.yaml");
  seen.learn_empty_scene({wall()});
  const SourceImage source{0, 0, image(0), Clock::now()};
  FootageFrame found = seen.preprocess(source);
  EXPECT_GT(cv::countNonZero(found.masks.at(0)), 0) << "found by the first stage, without the network";
  seen.detect(source, found);
  EXPECT_GT(found.evidence.at(0).keypoints.at(0).confidence, 0.9f);
}

TEST_F(LiveNetwork, WithoutANetworkForMasksTheyAreMissed) {
  write("");
  LiveView seen = view("network.yaml");
  const SourceImage source{0, 0, image(0), Clock::now()};
  EXPECT_THAT(message_of<Error>([&] { seen.preprocess(source); }), HasSubstr("masks"));
}

}  // namespace
}  // namespace doppel::network_finder_test
