#include "doppel/dnn/onnx_edits.h"

#include <gtest/gtest.h>

#include <opencv2/dnn.hpp>

#include "support/hostile_files.h"
#include "support/onnx_file.h"

namespace doppel::onnx_edits_test {
namespace {

using support::OnnxFile;

/// @param limits names of inputs: "low" and "high" are constants, "" is none
std::string clip_net(const std::vector<std::string>& limits) {
  OnnxFile net;
  net.input("image", {1, 1, 1, 4}).output("clipped", {1, 1, 1, 4});
  net.floats("low", {}, {-1.0f}).number_node("high", 2.0f);
  std::vector<std::string> inputs{"image"};
  inputs.insert(inputs.end(), limits.begin(), limits.end());
  net.node("Clip", inputs, {"clipped"});
  return net.bytes();
}

std::vector<float> run(const std::string& onnx) {
  const std::string readable = with_readable_clips(onnx);
  cv::dnn::Net net = cv::dnn::readNetFromONNX(readable.data(), readable.size());
  const int shape[] = {1, 1, 1, 4};
  cv::Mat input(4, shape, CV_32F);
  std::copy_n(std::begin({-5.0f, -0.5f, 1.5f, 9.0f}), 4, input.ptr<float>());
  net.setInput(input);
  const cv::Mat output = net.forward();
  return {output.ptr<float>(), output.ptr<float>() + output.total()};
}

TEST(ReadableClips, LimitsOfAllForms) {
  EXPECT_EQ(run(clip_net({"low", "high"})), (std::vector<float>{-1.0f, -0.5f, 1.5f, 2.0f}));
  EXPECT_EQ(run(clip_net({"low"})), (std::vector<float>{-1.0f, -0.5f, 1.5f, 9.0f}));
  EXPECT_EQ(run(clip_net({"", "high"})), (std::vector<float>{-5.0f, -0.5f, 1.5f, 2.0f}));
}

TEST(ReadableClips, OtherFilesStayAsTheyAre) {
  EXPECT_EQ(with_readable_clips(clip_net({})), clip_net({}));
  EXPECT_EQ(with_readable_clips(clip_net({"image"})), clip_net({"image"})) << "no constant";
  for (const char* text : {"", "this is no network", "\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff", "\x3a\x7f"})
    EXPECT_EQ(with_readable_clips(text), text);
}

TEST(ReadableClips, SurvivesHostileFiles) {
  for (const support::HostileFile& file : support::hostile_variants(clip_net({"low", "high"})))
    EXPECT_LE(with_readable_clips(file.content).size(), file.content.size() + 100) << file.what;
}

}  // namespace
}  // namespace doppel::onnx_edits_test
