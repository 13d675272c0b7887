#include "detect_network.h"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>

#include "detect/networks/small_networks.h"
#include "doppel/core/error.h"
#include "doppel/detect/keypoints/read_keypoints.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::detect_network_test {
namespace {

namespace fs = std::filesystem;
using namespace test_networks;
using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kFrames = 3;

/// Three images of three dots, and networks of the same size.
class DetectWithNetwork : public ::testing::Test {
 protected:
  DetectWithNetwork() {
    fs::create_directories(folder_ / "film");
    for (int frame = 0; frame < kFrames; ++frame) {
      cv::Mat image = black(80, 60);
      if (frame != 1)
        for (int channel = 0; channel < 3; ++channel) add_dot(image, channel, x(frame, channel), 30.2, 2.0);
      cv::imwrite((folder_ / fmt::format("film/{}.png", frame)).string(), image);
    }
    // Scores of centre_net are 0 where a colour is missing: nobody is in the second image.
    support::write_bytes(
        folder_ / "pose.onnx",
        centre_net(80, 60, {x_of(0), y_of(0), sum_of(0), x_of(1), y_of(1), sum_of(1), x_of(2), y_of(2), sum_of(2)},
                   {0, 0, 0, 1, 1, 1, 2, 2, 2}, {1, 3, 3}));
    support::write_bytes(folder_ / "mask.onnx", class_net(80, 60, 1, {20.0f}, {-6.0f}));
    support::write_bytes(folder_ / "map.yaml", "points: [blue, green, red]\nevery_point: true\n");
    support::write_bytes(folder_ / "net.yaml", "input: [80, 60]\nmask: {model: mask.onnx, input: [80, 60]}\n");
    source_ = detect_sources_of((folder_ / "film").string());
  }
  static tools::DetectSource detect_sources_of(const std::string& path) { return tools::detect_sources(path).at(0); }
  static double x(int frame, int channel) { return 20.4 + 3.1 * frame + 15.0 * channel; }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  tools::DetectReport detect(const tools::DetectNetwork& chosen, const tools::DetectFiles& files) const {
    PersonNetwork network(chosen.options, static_cast<int>(chosen.layout.points.size()));
    return tools::detect_camera_with(chosen, network, source_, files, std::nullopt, [] { return true; }).value();
  }
  support::TemporaryFolder folder_;
  tools::DetectSource source_;
};

TEST_F(DetectWithNetwork, NumbersOfImagesMayOutgrowTheirZeros) {
  std::filesystem::create_directory(folder_ / "many");
  for (const char* number : {"07", "99", "100"})
    support::write_bytes(folder_ / "many" / fmt::format("f_{}.png", number), "");
  const tools::DetectSource many = detect_sources_of(path("many"));
  EXPECT_EQ(many.frames, (std::vector<long>{7, 99, 100}));
  EXPECT_TRUE(many.images.ends_with("f_{frame:02}.png")) << many.images;
  support::write_bytes(folder_ / "many/f_0101.png", "");
  EXPECT_THROW(detect_sources_of(path("many")), UsageError);
}

TEST_F(DetectWithNetwork, WritesTheTableAndTheMasks) {
  const tools::DetectNetwork chosen =
      tools::choose_network(path("pose.onnx"), path("net.yaml"), path("map.yaml"), true);
  const tools::DetectReport report = detect(chosen, {folder_ / "out.csv", {}, folder_ / "masks"});
  EXPECT_EQ(report.frames, kFrames);
  EXPECT_EQ(report.with_person, kFrames - 1);
  EXPECT_NEAR(report.mean_confidence, 1.0, 0.01);
  const auto people = read_all_people(folder_ / "out.csv", chosen.layout, {source_.camera});
  for (const int frame : {0, 2}) {
    const Person& person = people.at(frame).at(0);
    for (int channel = 0; channel < 3; ++channel) {
      EXPECT_NEAR(person[channel].x, x(frame, channel), 0.1);
      EXPECT_NEAR(person[channel].y, 30.2, 0.1);
    }
    const cv::Mat mask = cv::imread(path(fmt::format("masks/{:06}.png", frame)), cv::IMREAD_GRAYSCALE);
    ASSERT_EQ(mask.size(), cv::Size(80, 60));
    EXPECT_GT(mask.at<std::uint8_t>(30, static_cast<int>(x(frame, 1))), 128);
    EXPECT_LT(mask.at<std::uint8_t>(5, 5), 128);
  }
  EXPECT_EQ(cv::countNonZero(cv::imread(path("masks/000001.png"), cv::IMREAD_GRAYSCALE)), 0) << "nobody is there";
}

TEST_F(DetectWithNetwork, WithoutALayoutItFindsMasks) {
  support::write_bytes(folder_ / "net.yaml", "model: mask.onnx\ninput: [80, 60]\n");
  const tools::DetectNetwork chosen = tools::choose_network("", path("net.yaml"), "", true);
  EXPECT_EQ(chosen.options.network.model, folder_ / "mask.onnx");
  detect(chosen, {{}, {}, folder_ / "masks"});
  EXPECT_FALSE(fs::exists(folder_ / "out.csv"));
  const cv::Mat mask = cv::imread(path("masks/000002.png"), cv::IMREAD_GRAYSCALE);
  EXPECT_GT(mask.at<std::uint8_t>(30, static_cast<int>(x(2, 0))), 128);
}

TEST_F(DetectWithNetwork, RefusesWhatCannotBe) {
  const auto refusal = [&](const std::string& model, const std::string& config, const std::string& layout, bool masks) {
    return message_of<UsageError>([&] { tools::choose_network(model, config, layout, masks); });
  };
  EXPECT_THAT(refusal("", path("net.yaml"), "coco17", false), AllOf(HasSubstr("--network"), HasSubstr("net.yaml")));
  EXPECT_THAT(refusal(path("pose.onnx"), "", "coco17", true), AllOf(HasSubstr("--masks"), HasSubstr("pose.onnx")));
  EXPECT_THAT(refusal(path("pose.onnx"), "rtmpos", "coco17", false), HasSubstr("rtmpose"));
  EXPECT_THAT(refusal(path("pose.onnx"), "", "coco", false), HasSubstr("coco"));
  // More points than the network has.
  const tools::DetectNetwork chosen = tools::choose_network(path("pose.onnx"), path("net.yaml"), "coco17", false);
  EXPECT_THAT(message_of<Error>([&] {
                detect(chosen, {folder_ / "out.csv", {}, {}});
              }),
              AllOf(HasSubstr("pose.onnx"), HasSubstr("17 points"), HasSubstr("[1, 3, 3]")));
  EXPECT_FALSE(fs::exists(folder_ / "out.csv"));
}

}  // namespace
}  // namespace doppel::detect_network_test
