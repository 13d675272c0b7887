#include "doppel/detect/blazepose/tflite_model.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "detect/blazepose/small_model.h"
#include "doppel/detect/blazepose/network.h"
#include "doppel/detect/blazepose/network_shapes.h"
#include "doppel/detect/blazepose/sparse_constant.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::tflite_model_test {
namespace {

using support::mean_and_product_network;
using support::mixed_network;
using support::SmallModel;
using Op = tflite::BuiltinOperator;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class TfliteFile : public ::testing::Test {
 protected:
  NetworkModel read(const std::string& content) const {
    support::write_bytes(path_, content);
    return read_tflite(path_);
  }
  std::string complaint(const std::string& content) const {
    return support::message_of<FileError>([&] { read(content); });
  }
  support::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "net.tflite";
};

TEST_F(TfliteFile, ReadsHalvesAndSparseConstants) {
  const NetworkModel model = read(mixed_network());
  ASSERT_EQ(model.operators.size(), 5u) << "DENSIFY and DEQUANTIZE are done while reading";
  ASSERT_EQ(model.operators[0].op, NetworkOp::conv_2d);
  const NetworkTensor& weights = model.tensors[static_cast<std::size_t>(model.operators[0].inputs[1])];
  ASSERT_NE(weights.values, nullptr);
  EXPECT_THAT(*weights.values, ElementsAre(0, 1, -2, 0));  // row 0 has a 1 in column 1, row 1 a -2 in column 0
}

TEST_F(TfliteFile, AMixedNetworkRuns) {
  Network network(read(mixed_network()), 2);
  for (std::size_t i = 0; i < 32; ++i) network.input()[i] = static_cast<float>(i);
  network.run();
  // Pixel (0, 0) of the pool: channel 0 is the largest input of channel 1 (index 11), channel 1 is 10 - 2 * 0.
  EXPECT_FLOAT_EQ(network.output(0)[0], 11);
  EXPECT_FLOAT_EQ(network.output(0)[1], 10);
  EXPECT_FLOAT_EQ(network.output(0)[2], 0);
  EXPECT_FLOAT_EQ(network.output(0)[16], 11);
}

TEST_F(TfliteFile, SurvivesHostileFiles) {
  support::expect_survives_hostile_files(
      path_, mixed_network(), [&](const std::filesystem::path& path) { Network(read_tflite(path)).run(); }, 200);
}

TEST_F(TfliteFile, SurvivesEveryChangedByte) {
  for (const std::string& valid : {mixed_network(), mean_and_product_network()}) {
    std::size_t refused = 0;
    for (std::size_t i = 0; i < valid.size(); ++i) {
      for (const int change : {0x01, 0x80, 0xff}) {
        std::string broken = valid;
        broken[i] = static_cast<char>(broken[i] ^ change);
        const std::string message =
            support::expect_rejects_or_reads("byte " + std::to_string(i), [&] { Network(read(broken)).run(); });
        refused += !message.empty();
      }
    }
    EXPECT_GT(refused, valid.size() / 4);
  }
}

TEST_F(TfliteFile, NamesAnUnknownOperator) {
  SmallModel model;
  const int in = model.tensor({1, 4}), out = model.tensor({1, 4});
  model.step(Op::SOFTMAX, {in}, out);
  EXPECT_THAT(complaint(model.file({in}, {out})),
              AllOf(HasSubstr("net.tflite"), HasSubstr("operator 0, SOFTMAX"), HasSubstr("known are ADD")));
  model.model().operator_codes[0]->code = static_cast<Op>(150);
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("operator 0, operator 150"));
  model.model().operator_codes[0]->code = Op::CUSTOM;
  model.model().operator_codes[0]->custom_code = "Mine";
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("custom operator Mine"));
}

TEST_F(TfliteFile, ReadsTheOperatorNumberOfOlderFiles) {
  SmallModel model;
  const int in = model.tensor({1, 4}), out = model.tensor({1, 4});
  model.step(Op::ADD, {in}, out);
  model.model().operator_codes[0]->old_code = 14;
  EXPECT_EQ(read(model.file({in}, {out})).operators.at(0).op, NetworkOp::logistic);
}

TEST_F(TfliteFile, RefusesWrongShapes) {
  SmallModel model;
  const int in = model.tensor({1, 4, 4, 2}), out = model.tensor({1, 4, 4, 3});
  model.step(Op::LOGISTIC, {in}, out);
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("the file says 1x4x4x3, but its inputs give 1x4x4x2"));
}

TEST_F(TfliteFile, RefusesWrongIndices) {
  SmallModel model;
  const int in = model.tensor({1, 4}), out = model.tensor({1, 4});
  model.step(Op::LOGISTIC, {7}, out);
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("tensor 7 does not exist, the network has 2"));
  model.graph().operators[0]->inputs = {in};
  EXPECT_THAT(complaint(model.file({in}, {-1})), HasSubstr("tensor -1 does not exist"));
  EXPECT_THAT(complaint(model.file({in}, {in})), HasSubstr("is not computed by any operator"));
  EXPECT_THAT(complaint(model.file({in}, {out, out})), HasSubstr("or an output twice"));
  EXPECT_THAT(complaint(model.file({in}, {})), HasSubstr("the outputs of the network: there are none"));
  EXPECT_THAT(complaint(model.file({out}, {out})), HasSubstr("is not computed before"));
  model.stored(out).buffer = 9;
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("has buffer 9, but the file has 1"));
}

TEST_F(TfliteFile, RefusesHugeTensors) {
  SmallModel model;
  const int in = model.tensor({1, 40000, 40000, 4}), out = model.tensor({1, 40000, 40000, 4});
  model.step(Op::LOGISTIC, {in}, out);
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("need more than 1 GB"));
  model.stored(in).shape = model.stored(out).shape = {2147483647, 2147483647, 2147483647, 2147483647};
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("need more than 1 GB"));
}

TEST_F(TfliteFile, RefusesConstantsOfAnotherSize) {
  SmallModel model;
  const int in = model.tensor({1, 4}), out = model.tensor({1, 4});
  model.step(Op::ADD, {in, model.constant({1, 4}, {1, 2, 3})}, out, tflite::AddOptionsT());
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("has 3 values, its shape 1x4 needs 4"));
}

TEST_F(TfliteFile, RefusesToConvertComputedTensors) {
  SmallModel model;
  const int in = model.tensor({1, 4}), out = model.tensor({1, 4});
  model.step(Op::DEQUANTIZE, {in}, out);
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("only constants can be converted"));
}

TEST_F(TfliteFile, RefusesOtherKindsOfResizing) {
  SmallModel model;
  const int in = model.tensor({1, 2, 2, 1}), out = model.tensor({1, 4, 4, 1});
  model.step(Op::RESIZE_BILINEAR, {in, model.integers({2}, {4, 4})}, out, tflite::ResizeBilinearOptionsT());
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("must have half-pixel centres"));
}

TEST_F(TfliteFile, RefusesMeansOverOtherAxes) {
  SmallModel model;
  const int in = model.tensor({1, 4, 4, 2}), out = model.tensor({1, 4, 4}), axes = model.integers({1}, {3});
  model.step(Op::MEAN, {in, axes}, out);
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("must be over the axes 1 and 2 of an image"));
}

TEST_F(TfliteFile, RefusesProductsThatDoNotFit) {
  SmallModel model;
  const int in = model.tensor({1, 4}), out = model.tensor({1, 2}), weights = model.constant({2, 3}, {1, 2, 3, 4, 5, 6}),
            bias = model.constant({2}, {0, 0});
  tflite::FullyConnectedOptionsT options;
  model.step(Op::FULLY_CONNECTED, {in, weights, bias}, out, options);
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("its input is 1x4 and its weights are 2x3"));
  model.stored(in).shape = {1, 3};
  model.stored(bias).shape = {1, 2};
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("its bias is 1x2 for 2 outputs"));
  options.weights_format = 1;
  model.graph().operators[0]->options.Set(std::move(options));
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("needs options, and weights in rows"));
}

TEST_F(TfliteFile, MayBeAPartOfALargerFile) {
  const std::string network = mixed_network();
  support::write_bytes(path_, "before" + network + "behind");
  const NetworkModel part = read_tflite(path_, FilePart{6, network.size()});
  EXPECT_EQ(part.operators.size(), read(network).operators.size());
  support::write_bytes(path_, "before" + network);
  for (const FilePart& beyond : {FilePart{6, network.size() + 1}, FilePart{network.size() + 7, 0}, FilePart{7, ~0ull}})
    EXPECT_THAT(support::message_of<FileError>([&] { read_tflite(path_, beyond); }),
                HasSubstr(fmt::format("{} bytes from byte {}, but the file has {}", beyond.size, beyond.offset,
                                      network.size() + 6)));
}

TEST_F(TfliteFile, RefusesFactorsThatDoNotFit) {
  SmallModel model;
  const int in = model.tensor({1, 2, 2, 3}), out = model.tensor({1, 2, 2, 3}),
            factors = model.constant({1, 1, 2}, {1, 2});
  model.step(Op::PRELU, {in, factors}, out);
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("its factors are 1x1x2, expected 1x1x3"));
  model.graph().operators[0]->inputs = {in, in};
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("is no constant"));
}

TEST_F(TfliteFile, RefusesDilations) {
  SmallModel model;
  const int in = model.tensor({1, 4, 4, 1}), out = model.tensor({1, 4, 4, 1});
  tflite::Conv2DOptionsT options;
  options.stride_w = options.stride_h = 1;
  options.dilation_w = 2;
  model.step(Op::CONV_2D, {in, model.constant({1, 1, 1, 1}, {1}), model.constant({1}, {0})}, out, options);
  EXPECT_THAT(complaint(model.file({in}, {out})), HasSubstr("has dilations 2 and 1, expected 1"));
}

TEST(SparseConstant, ExpandsRows) {
  const SparseRows rows{{0, 2, 2, 3}, {0, 3, 1}};
  const auto dense = expand_rows(rows, {5, 6, 7}, {3, 1, 4});
  ASSERT_TRUE(dense);
  EXPECT_THAT(*dense, ElementsAre(5, 0, 0, 6, 0, 0, 0, 0, 0, 7, 0, 0));
}

TEST(SparseConstant, RefusesRowsAndColumnsThatContradict) {
  const std::vector<float> stored{5, 6, 7};
  const TensorShape shape{3, 4};
  EXPECT_FALSE(expand_rows({{0, 2, 3}, {0, 3, 1}}, stored, shape)) << "two rows";
  EXPECT_FALSE(expand_rows({{0, 2, 1, 3}, {0, 3, 1}}, stored, shape)) << "rows that descend";
  EXPECT_FALSE(expand_rows({{0, 2, 2, 4}, {0, 3, 1}}, stored, shape)) << "more elements than stored";
  EXPECT_FALSE(expand_rows({{0, 2, 2, 3}, {0, 4, 1}}, stored, shape)) << "a column outside";
  EXPECT_FALSE(expand_rows({{0, 2, 2, 3}, {0, -1, 1}}, stored, shape)) << "a negative column";
  EXPECT_FALSE(expand_rows({{0, 2, 2, 3}, {3, 3, 1}}, stored, shape)) << "a column twice";
  EXPECT_FALSE(expand_rows({{0, 2, 2, 3}, {0, 3}}, stored, shape)) << "a column too few";
}

TEST(NetworkShapes, SamePaddingIsThatOfTensorFlow) {
  const auto padding = [](int size, int window, int stride) {
    const SamePadding p = same_padding(size, window, stride);
    return std::pair(p.before, p.after);
  };
  EXPECT_EQ(padding(8, 3, 1), std::pair(std::int64_t{1}, std::int64_t{1}));
  EXPECT_EQ(padding(8, 3, 2), std::pair(std::int64_t{0}, std::int64_t{1}));
  EXPECT_EQ(padding(9, 3, 2), std::pair(std::int64_t{1}, std::int64_t{1}));
  EXPECT_EQ(padding(8, 1, 2), std::pair(std::int64_t{0}, std::int64_t{0}));
}

}  // namespace
}  // namespace doppel::tflite_model_test
