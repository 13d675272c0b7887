#include "doppel/detect/networks/onnx_edits.h"

#include <gtest/gtest.h>

#include <numeric>
#include <opencv2/dnn.hpp>

#include "support/hostile_files.h"
#include "support/onnx_file.h"

namespace doppel::onnx_edits_test {
namespace {

using support::OnnxFile;

/// The output for the input 1, 2, 3, ...
std::vector<float> run(const std::string& onnx, std::vector<int> shape, float first = 1.0f) {
  const std::string readable = readable_onnx(onnx);
  cv::dnn::Net net = cv::dnn::readNetFromONNX(readable.data(), readable.size());
  cv::Mat input(static_cast<int>(shape.size()), shape.data(), CV_32F);
  std::iota(input.ptr<float>(), input.ptr<float>() + input.total(), first);
  net.setInput(input);
  const cv::Mat output = net.forward();
  return {output.ptr<float>(), output.ptr<float>() + output.total()};
}

/// @param limits names of inputs: "low" and "high" are constants, "" is none
std::string clip_net(const std::vector<std::string>& limits) {
  OnnxFile net;
  net.input("image", {1, 1, 1, 4}).output("clipped", {1, 1, 1, 4});
  net.floats("low", {}, {-1.0f}).number_node("high", 0.5f);
  std::vector<std::string> inputs{"image"};
  inputs.insert(inputs.end(), limits.begin(), limits.end());
  net.node("Clip", inputs, {"clipped"});
  return net.bytes();
}

TEST(ReadableOnnx, LimitsOfClipInAllForms) {
  const std::vector<int> shape{1, 1, 1, 4};
  EXPECT_EQ(run(clip_net({"low", "high"}), shape, -2.0f), (std::vector<float>{-1.0f, -1.0f, 0.0f, 0.5f}));
  EXPECT_EQ(run(clip_net({"low"}), shape, -2.0f), (std::vector<float>{-1.0f, -1.0f, 0.0f, 1.0f}));
  EXPECT_EQ(run(clip_net({"", "high"}), shape, -2.0f), (std::vector<float>{-2.0f, -1.0f, 0.0f, 0.5f}));
}

TEST(ReadableOnnx, ProductsWithARow) {
  for (const std::vector<int>& constant : {std::vector<int>{3}, {1, 1, 3}})
    for (const bool first : {false, true}) {
      OnnxFile net;
      net.input("x", {1, 2, 3}).output("y", {1, 2, 3}).floats("row", constant, {1, 10, 100});
      net.node("Mul", first ? std::vector<std::string>{"row", "x"} : std::vector<std::string>{"x", "row"}, {"y"});
      EXPECT_EQ(run(net.bytes(), {1, 2, 3}), (std::vector<float>{1, 20, 300, 4, 50, 600}));
    }
}

TEST(ReadableOnnx, ProductsWithRowsAfterUnsqueeze) {
  OnnxFile net;
  net.input("x", {1, 2, 3}).output("y", {1, 2, 2, 3}).floats("rows", {1, 1, 2, 3}, {1, 10, 100, -1, -10, -100});
  net.node("Unsqueeze", {"x"}, {"x4"}, {OnnxFile::ints("axes", {2})}).node("Mul", {"x4", "rows"}, {"y"});
  EXPECT_EQ(run(net.bytes(), {1, 2, 3}), (std::vector<float>{1, 20, 300, -1, -20, -300, 4, 50, 600, -4, -50, -600}));
}

TEST(ReadableOnnx, OtherFilesStayAsTheyAre) {
  for (const std::string& net : {clip_net({}), clip_net({"image"})}) EXPECT_EQ(readable_onnx(net), net);
  OnnxFile channels;
  channels.input("x", {1, 2, 3, 3}).output("y", {1, 2, 3, 3}).floats("c", {1, 2, 1, 1}, {2, 3});
  channels.node("Mul", {"x", "c"}, {"y"});
  EXPECT_EQ(readable_onnx(channels.bytes()), channels.bytes()) << "OpenCV knows factors of channels";
  for (const char* text : {"", "this is no network", "\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff", "\x3a\x7f"})
    EXPECT_EQ(readable_onnx(text), text);
}

TEST(ReadableOnnx, SurvivesHostileFiles) {
  OnnxFile net;
  net.input("x", {1, 2, 3}).output("y", {1, 2, 2, 3}).floats("rows", {1, 1, 2, 3}, {1, 10, 100, -1, -10, -100});
  net.node("Unsqueeze", {"x"}, {"x4"}, {OnnxFile::ints("axes", {2})}).node("Mul", {"x4", "rows"}, {"y"});
  for (const std::string& valid : {clip_net({"low", "high"}), net.bytes()})
    for (const support::HostileFile& file : support::hostile_variants(valid))
      EXPECT_LE(readable_onnx(file.content).size(), file.content.size() + 1000) << file.what;
}

}  // namespace
}  // namespace doppel::onnx_edits_test
