#include "doppel/detect/blazepose/network_edits.h"

#include <gtest/gtest.h>

#include "detect/blazepose/small_model.h"
#include "doppel/detect/blazepose/network.h"
#include "doppel/detect/blazepose/network_shapes.h"
#include "doppel/detect/blazepose/tflite_model.h"
#include "support/hostile_files.h"
#include "support/temporary_folder.h"

namespace doppel::network_edits_test {
namespace {

using support::SmallModel;
using Op = tflite::BuiltinOperator;

/// A pad before a convolution of 2x2; the pad's result may be an output, too.
class PaddedConvolution {
 public:
  explicit PaddedConvolution(const std::vector<std::int32_t>& pads, bool pad_is_output = false) {
    const int channels = 1 + pads[6] + pads[7], height = 3 + pads[2] + pads[3], width = 3 + pads[4] + pads[5];
    const int in = small_.tensor({1, 3, 3, 1}), padded = small_.tensor({1, height, width, channels});
    const int out = small_.tensor({1, height - 1, width - 1, 1});
    small_.step(Op::PAD, {in, small_.integers({4, 2}, pads)}, padded);
    tflite::Conv2DOptionsT options;
    options.padding = tflite::Padding::VALID;
    options.stride_w = options.stride_h = 1;
    const std::vector<float> weights(std::size_t(4 * channels), 0.5f);
    small_.step(Op::CONV_2D, {padded, small_.constant({1, 2, 2, channels}, weights), small_.constant({1}, {3})}, out,
                options);
    const support::TemporaryFolder folder;
    support::write_bytes(folder / "a.tflite",
                         small_.file({in}, pad_is_output ? std::vector<int>{out, padded} : std::vector<int>{out}));
    model = read_tflite(folder / "a.tflite");
  }
  NetworkModel model;

 private:
  SmallModel small_;
};

TEST(FoldPadding, MakesThePadPartOfTheConvolution) {
  const NetworkModel model = PaddedConvolution({0, 0, 1, 0, 2, 1, 0, 0}).model, folded = fold_padding(model);
  ASSERT_EQ(folded.operators.size(), 1u);
  EXPECT_EQ(folded.operators[0].inputs[0], model.inputs[0]);
  EXPECT_NO_THROW(check_shapes(folded));
  Network network(model, 1);
  for (std::size_t i = 0; i < 9; ++i) network.input()[i] = static_cast<float>(i + 1);
  network.run();
  // Rows: zeros, 1 2 3, 4 5 6, 7 8 9; columns: two zeros before, one after.
  const std::vector<float> expected{3, 3.5f, 4.5f, 5.5f, 4.5f, 3, 5.5f, 9, 11, 7.5f, 3, 8.5f, 15, 17, 10.5f};
  ASSERT_EQ(network.output(0).size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_FLOAT_EQ(network.output(0)[i], expected[i]) << i;
}

TEST(FoldPadding, KeepsPadsOfChannelsAndPadsThatAreReadElsewhere) {
  EXPECT_EQ(fold_padding(PaddedConvolution({0, 0, 0, 0, 0, 0, 1, 2}).model).operators.size(), 2u);
  EXPECT_EQ(fold_padding(PaddedConvolution({0, 0, 1, 1, 1, 1, 0, 0}, true).model).operators.size(), 2u);
}

TEST(KeepOutputs, DropsOperatorsThatNothingNeeds) {
  SmallModel small;
  const int in = small.tensor({1, 4}), a = small.tensor({1, 4}), b = small.tensor({1, 4}), c = small.tensor({1, 4});
  small.step(Op::LOGISTIC, {in}, a);
  small.step(Op::ADD, {a, a}, b, tflite::AddOptionsT());
  small.step(Op::ADD, {a, in}, c, tflite::AddOptionsT());
  const support::TemporaryFolder folder;
  support::write_bytes(folder / "a.tflite", small.file({in}, {a, b, c}));
  const NetworkModel kept = keep_outputs(read_tflite(folder / "a.tflite"), {2, 0});
  EXPECT_EQ(kept.outputs, (std::vector<int>{c, a}));
  ASSERT_EQ(kept.operators.size(), 2u);
  EXPECT_EQ(kept.operators[0].output, a);
  EXPECT_EQ(kept.operators[1].output, c);
  EXPECT_NO_THROW(check_shapes(kept));
}

}  // namespace
}  // namespace doppel::network_edits_test
