#include <gmock/gmock.h>

#include <limits>

#include "detect/networks/small_networks.h"
#include "doppel/core/error.h"
#include "doppel/detect/networks/output_choice.h"
#include "doppel/detect/networks/person_network.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::output_adapter_test {
namespace {

using namespace test_networks;
using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using Vec = Eigen::Vector2d;

constexpr double kExact = 0.1;  ///< pixels

class Adapters : public ::testing::Test {
 protected:
  PersonNetworkOptions options(const std::string& bytes, int width, int height) {
    support::write_bytes(folder_ / "net.onnx", bytes);
    PersonNetworkOptions all;
    all.network.model = folder_ / "net.onnx";
    all.network.input = {width, height};
    return all;
  }
  /// The image is as large as the network's input.
  static std::optional<PersonFinding> find(const PersonNetworkOptions& options, const cv::Mat& image, int points = 3) {
    return PersonNetwork(options, points).find(image);
  }
  static void expect_at(const NetworkPoint& point, double x, double y, double tolerance = kExact) {
    EXPECT_GT(point.score, 0.0);
    EXPECT_NEAR(point.position.x(), x, tolerance);
    EXPECT_NEAR(point.position.y(), y, tolerance);
  }
  std::string refusal(const PersonNetworkOptions& all, int points = 3) {
    const cv::Mat image(all.network.input, CV_8UC3, cv::Scalar::all(90));
    const std::string message = message_of<Error>([&] { find(all, image, points); });
    EXPECT_THAT(message, HasSubstr("net.onnx"));
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    return message;
  }
  support::TemporaryFolder folder_;
};

TEST_F(Adapters, HeatmapsOnTheGridsThatNetworksUse) {
  // Entry i is pixel 4 i: with 49x33 pixels and 13x9 entries these are the ends, with 48x32 and 12x8 the samples.
  for (const OutputGrid grid : {OutputGrid::ends, OutputGrid::samples}) {
    const int width = grid == OutputGrid::ends ? 49 : 48, height = grid == OutputGrid::ends ? 33 : 32;
    PersonNetworkOptions all = options(heatmap_net(width, height, 4), width, height);
    all.network.grid = grid;
    all.network.refine = PeakRefinement::none;
    cv::Mat image = black(width, height);
    image.at<cv::Vec3b>(12, 20)[0] = 250;
    image.at<cv::Vec3b>(28, 44)[2] = 250;
    const auto person = find(all, image);
    ASSERT_TRUE(person);
    expect_at(person->points[0], 20.5, 12.5, 1e-9);
    EXPECT_EQ(person->points[1].score, 0.0) << "nothing is green";
    expect_at(person->points[2], 44.5, 28.5, 1e-9);
    EXPECT_NEAR(person->points[0].score, 250.0 / 255.0, 1e-6);
  }
}

TEST_F(Adapters, DarkFindsTheCentreOfAGaussian) {
  // The logarithm of a Gaussian is quadratic, so eq. 7 is exact. The blur widens it and keeps its centre; its kernel
  // ends after 2.5 sigma.
  for (const int blur : {0, 11}) {
    PersonNetworkOptions all = options(heatmap_net(96, 128, 4), 96, 128);
    all.network.grid = OutputGrid::samples;
    all.network.refine = PeakRefinement::dark;
    all.network.blur = blur;
    for (const double shift : {0.0, 0.7, 1.9, 3.3}) {
      cv::Mat image = black(96, 128);
      add_dot(image, 0, 48.5 + shift, 60.5 - shift, 8.0);
      const auto person = find(all, image);
      ASSERT_TRUE(person);
      expect_at(person->points[0], 48.5 + shift, 60.5 - shift);
    }
  }
}

TEST_F(Adapters, PeaksAreRefinedByTheirNeighbours) {
  PersonNetworkOptions all = options(heatmap_net(32, 24, 1), 32, 24);
  cv::Mat image = black(32, 24);
  for (const auto& [x, y, value] : {std::tuple(10, 8, 200), {9, 8, 100}, {11, 8, 150}, {10, 7, 180}, {10, 9, 180}})
    image.at<cv::Vec3b>(y, x)[1] = static_cast<std::uint8_t>(value);
  const auto with = [&](PeakRefinement refine) {
    all.network.refine = refine;
    return find(all, image).value().points[1];
  };
  expect_at(with(PeakRefinement::none), 10.5, 8.5, 1e-9);
  expect_at(with(PeakRefinement::quarter), 10.75, 8.5, 1e-9);
  // 0.5 (100 - 150) / (100 - 400 + 150) = 1/6
  expect_at(with(PeakRefinement::parabola), 10.5 + 1.0 / 6.0, 8.5, 1e-6);
}

TEST_F(Adapters, SimccWithTheBinsOfBothOutputs) {
  for (const int ratio : {1, 2, 3}) {
    const PersonNetworkOptions all = options(simcc_net(48, 64, ratio), 48, 64);
    cv::Mat image = black(48, 64);
    image.at<cv::Vec3b>(50, 17)[0] = 255;
    image.at<cv::Vec3b>(3, 40)[1] = 128;
    const auto person = find(all, image);
    ASSERT_TRUE(person);
    expect_at(person->points[0], 17.5, 50.5);
    expect_at(person->points[1], 40.5, 3.5);
    EXPECT_NEAR(person->points[1].score, 128.0 / 255.0, 1e-6) << "the smaller maximum";
    EXPECT_EQ(person->points[2].score, 0.0);
  }
}

TEST_F(Adapters, SimccBinsBelowTheGrid) {
  PersonNetworkOptions all = options(simcc_net(48, 64, 1), 48, 64);
  cv::Mat image = black(48, 64);
  add_dot(image, 2, 20.3, 33.9, 3.0);
  for (const PeakRefinement refine : {PeakRefinement::parabola, PeakRefinement::dark}) {
    all.network.refine = refine;
    all.network.blur = 0;
    expect_at(find(all, image).value().points[2], 20.3, 33.9);
  }
}

/// The head of RTMPose: a convolution, ScaleNorm, a linear layer and a gated attention unit, then bins. The weights let
/// the convolution's values through: heat k at (x, y) becomes bin x and bin y of point k, up to a factor.
std::string rtmpose_head(int width, int height) {
  constexpr int kPoints = 3, kHidden = 8, kKey = 4;
  const int cells = width * height;
  OnnxFile net;
  net.input("image", {1, 3, height, width})
      .output("simcc_x", {1, kPoints, width * 2})
      .output("simcc_y", {1, kPoints, height * 2});
  net.floats("w", {3, 3, 1, 1}, {1, 0, 0, 0, 1, 0, 0, 0, 1});
  net.node("Conv", {"image", "w"}, {"heat"}, {OnnxFile::ints("kernel_shape", {1, 1})});
  net.integers("flat", {1, kPoints, cells}).node("Reshape", {"heat", "flat"}, {"rows"});
  // ScaleNorm: x / max(|x| n^-1/2, eps) * g
  const auto scale_norm = [&](const std::string& from, const std::string& to, int size) {
    net.floats(to + "_root", {1}, {1.0f / std::sqrt(static_cast<float>(size))}).floats(to + "_g", {1}, {1.0f});
    net.node("ReduceL2", {from}, {to + "_norm"}, {OnnxFile::ints("axes", {2}), OnnxFile::integer("keepdims", 1)});
    net.node("Mul", {to + "_norm", to + "_root"}, {to + "_scaled"});
    // The limit is a constant or a node: both are refused by OpenCV 4.6 as they are.
    if (from == "rows")
      net.floats(to + "_low", {}, {1e-5f}).node("Clip", {to + "_scaled", to + "_low", ""}, {to + "_safe"});
    else
      net.number_node(to + "_low", 1e-5f).node("Clip", {to + "_scaled", to + "_low"}, {to + "_safe"});
    net.node("Div", {from, to + "_safe"}, {to + "_unit"});
    net.node("Mul", {to + "_unit", to + "_g"}, {to});
  };
  scale_norm("rows", "normed", cells);
  scale_norm("normed", "gau_in", cells);
  std::vector<float> into(cells * (2 * kHidden + kKey), 0.01f);
  net.floats("into", {cells, 2 * kHidden + kKey}, into).node("MatMul", {"gau_in", "into"}, {"uv"});
  net.node("Sigmoid", {"uv"}, {"gate"}).node("Mul", {"uv", "gate"}, {"silu"});
  net.node("Split", {"silu"}, {"u", "v", "base"},
           {OnnxFile::integer("axis", 2), OnnxFile::ints("split", {kHidden, kHidden, kKey})});
  net.node("Unsqueeze", {"base"}, {"base4"}, {OnnxFile::ints("axes", {2})});
  net.floats("gamma", {1, 1, 2, kKey}, std::vector<float>(2 * kKey, 0.5f))
      .floats("beta", {2, kKey}, std::vector<float>(2 * kKey, 0.1f));
  net.node("Mul", {"base4", "gamma"}, {"scaled"}).node("Add", {"scaled", "beta"}, {"qk"});
  net.node("Split", {"qk"}, {"q4", "k4"}, {OnnxFile::integer("axis", 2), OnnxFile::ints("split", {1, 1})});
  net.node("Squeeze", {"q4"}, {"q"}, {OnnxFile::ints("axes", {2})})
      .node("Squeeze", {"k4"}, {"k"}, {OnnxFile::ints("axes", {2})});
  net.node("Transpose", {"k"}, {"kt"}, {OnnxFile::ints("perm", {0, 2, 1})}).node("MatMul", {"q", "kt"}, {"product"});
  net.node("Relu", {"product"}, {"positive"}).node("Mul", {"positive", "positive"}, {"kernel"});
  net.node("MatMul", {"kernel", "v"}, {"attended"}).node("Mul", {"u", "attended"}, {"gated"});
  net.floats("out", {kHidden, cells}, std::vector<float>(kHidden * cells, 0.0f))
      .node("MatMul", {"gated", "out"}, {"change"});
  net.floats("res", {cells}, std::vector<float>(cells, 1.0f)).node("Mul", {"normed", "res"}, {"shortcut"});
  net.node("Add", {"shortcut", "change"}, {"features"});
  std::vector<float> to_x(cells * width * 2, 0.0f), to_y(as_size(cells * height * 2), 0.0f);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      to_x[(y * width + x) * width * 2 + 2 * x] = 0.05f;
      to_y[(y * width + x) * height * 2 + 2 * y] = 0.05f;
    }
  net.floats("cls_x", {cells, width * 2}, to_x).node("MatMul", {"features", "cls_x"}, {"simcc_x"});
  net.floats("cls_y", {cells, height * 2}, to_y).node("MatMul", {"features", "cls_y"}, {"simcc_y"});
  return net.bytes();
}

TEST_F(Adapters, TheOperatorsOfRtmposesHeadRun) {
  cv::Mat image = black(24, 32);
  image.at<cv::Vec3b>(20, 7)[0] = 255;
  image.at<cv::Vec3b>(3, 20)[2] = 200;
  const auto person = find(options(rtmpose_head(24, 32), 24, 32), image);
  ASSERT_TRUE(person);
  expect_at(person->points[0], 7.5, 20.5);
  EXPECT_EQ(person->points[1].score, 0.0);
  expect_at(person->points[2], 20.5, 3.5);
}

TEST_F(Adapters, SimccOutputsInEitherOrder) {
  // OpenCV sorts outputs by name: here y comes first. In a square, only `outputs` can tell.
  cv::Mat image = black(48, 64);
  image.at<cv::Vec3b>(50, 17)[0] = 255;
  expect_at(find(options(simcc_net(48, 64, 2, "b", "a"), 48, 64), image).value().points[0], 17.5, 50.5);
  PersonNetworkOptions square = options(simcc_net(64, 64, 2, "b", "a"), 64, 64);
  square.network.outputs = {"b", "a"};
  image = black(64, 64);
  image.at<cv::Vec3b>(50, 17)[0] = 255;
  expect_at(find(square, image).value().points[0], 17.5, 50.5);
}

TEST_F(Adapters, CoordinatesAsNumbers) {
  cv::Mat image = black(40, 30);
  image.at<cv::Vec3b>(11, 30)[0] = 255;
  image.at<cv::Vec3b>(20, 5)[1] = 255;
  const std::vector<LinearOutput> pairs{x_of(0), y_of(0), x_of(1), y_of(1)};
  for (const std::vector<int>& shape : {std::vector<int>{1, 4}, {1, 2, 2}}) {
    const auto person = find(options(linear_net(40, 30, pairs, shape), 40, 30), image, 2);
    ASSERT_TRUE(person);
    expect_at(person->points[0], 30.5, 11.5);
    expect_at(person->points[1], 5.5, 20.5);
    EXPECT_EQ(person->points[0].score, 1.0) << "without scores";
  }
  // Fractions of the input, with scores: red has none.
  const double u = 1.0 / 40, v = 1.0 / 30;
  PersonNetworkOptions fractions = options(
      linear_net(40, 30, {x_of(0, u), y_of(0, v), sum_of(0, 0.8), x_of(2, u), y_of(2, v), sum_of(2)}, {1, 6}), 40, 30);
  fractions.network.fractions = true;
  const auto person = find(fractions, image, 2);
  ASSERT_TRUE(person);
  expect_at(person->points[0], 30.5, 11.5);
  EXPECT_NEAR(person->points[0].score, 0.8, 1e-5);
  EXPECT_EQ(person->points[1].score, 0.0);
}

TEST_F(Adapters, CoordinatesWithOtherValues) {
  cv::Mat image = black(40, 30);
  image.at<cv::Vec3b>(11, 30)[0] = 255;
  // Five values are those of MediaPipe: x, y, z, logit of visibility, logit of presence.
  const std::vector<LinearOutput> five{x_of(0), y_of(0), sum_of(0, 77.0), sum_of(0, 0.0, 1.5), sum_of(0, 5.0)};
  const auto person = find(options(linear_net(40, 30, five, {1, 5}), 40, 30), image, 1);
  ASSERT_TRUE(person);
  expect_at(person->points[0], 30.5, 11.5);
  EXPECT_NEAR(person->points[0].score, 1.0 / (1.0 + std::exp(-1.5)), 1e-5);
  // The same as y, score, x, one pixel's centre at whole numbers.
  const std::vector<LinearOutput> swapped{y_of(0, 1.0, -0.5), sum_of(0, 0.5), x_of(0, 1.0, -0.5)};
  PersonNetworkOptions all = options(linear_net(40, 30, swapped, {1, 3}), 40, 30);
  all.network.values = {"y", "score", "x"};
  all.network.grid = OutputGrid::samples;
  expect_at(find(all, image, 1).value().points[0], 30.5, 11.5);
}

TEST_F(Adapters, MasksOfOneTwoAndManyChannels) {
  cv::Mat image = black(48, 32);
  image(cv::Rect(16, 8, 16, 16)) = cv::Scalar::all(255);  // the sum of the colours is 3
  const auto sigmoid = [](double logit) { return 255.0 / (1.0 + std::exp(-logit)); };
  const auto expect_mask = [&](const PersonNetworkOptions& all, double inside, double outside) {
    const auto person = find(all, image, 0);
    ASSERT_TRUE(person);
    ASSERT_EQ(person->mask.size(), image.size());
    EXPECT_NEAR(person->mask.at<std::uint8_t>(16, 24), inside, 1.0);
    EXPECT_NEAR(person->mask.at<std::uint8_t>(16, 4), outside, 1.0);
    EXPECT_TRUE(person->points.empty());
  };
  for (const int stride : {1, 4}) {
    expect_mask(options(class_net(48, 32, stride, {1.0f}, {-1.5f}), 48, 32), sigmoid(1.5), sigmoid(-1.5));
    // The network has its own sigmoid: a second one would make 0.82 of 1.
    expect_mask(options(class_net(48, 32, stride, {1.0f}, {-1.5f}, "Sigmoid"), 48, 32), sigmoid(1.5), sigmoid(-1.5));
    expect_mask(options(class_net(48, 32, stride, {0.0f, 1.0f}, {0.5f, -1.0f}), 48, 32), sigmoid(1.5), sigmoid(-1.5));
    PersonNetworkOptions classes = options(class_net(48, 32, stride, {0, 1, 0}, {1.0f, -1.0f, -30.0f}), 48, 32);
    EXPECT_THAT(message_of<Error>([&] { find(classes, image, 0); }),
                AllOf(HasSubstr("3 classes"), HasSubstr("person")));
    classes.network.person = 1;
    expect_mask(classes, sigmoid(1.0), sigmoid(-2.0));
    PersonNetworkOptions plain = options(class_net(48, 32, stride, {0.25f}, {0.1f}), 48, 32);
    plain.network.activation = MaskActivation::none;
    expect_mask(plain, 255 * 0.85, 255 * 0.1);
  }
}

TEST_F(Adapters, MasksOfImagesOfAnotherSize) {
  cv::Mat image = black(192, 64);
  image(cv::Rect(64, 16, 64, 32)) = cv::Scalar::all(255);
  const auto person = find(options(class_net(48, 32, 1, {10.0f}, {-15.0f}), 48, 32), image, 0);
  ASSERT_TRUE(person);
  ASSERT_EQ(person->mask.size(), image.size());
  for (const int x : {66, 96, 125}) EXPECT_GT(person->mask.at<std::uint8_t>(32, x), 128) << x;
  for (const int x : {10, 61, 130, 190}) EXPECT_LT(person->mask.at<std::uint8_t>(32, x), 128) << x;
  for (const int y : {14, 49}) EXPECT_LT(person->mask.at<std::uint8_t>(y, 96), 128) << y;
}

TEST_F(Adapters, SayWhichShapesFit) {
  // As many points as the layout has.
  EXPECT_THAT(refusal(options(heatmap_net(48, 32, 4), 48, 32), 17),
              AllOf(HasSubstr("17 points"), HasSubstr("[1, 3, 8, 12]")));
  EXPECT_THAT(refusal(options(simcc_net(48, 64, 2), 48, 64), 17), AllOf(HasSubstr("17"), HasSubstr("[1, 3, 96]")));
  EXPECT_THAT(refusal(options(centres_net(48, 32), 48, 32), 17), AllOf(HasSubstr("17"), HasSubstr("[1, 6]")));
  // Another form than the one that is named.
  PersonNetworkOptions named = options(heatmap_net(48, 32, 4), 48, 32);
  named.network.output = OutputKind::simcc;
  EXPECT_THAT(refusal(named), AllOf(HasSubstr("SimCC"), HasSubstr("[1, 3, bins]")));
  named.network.output = OutputKind::points;
  EXPECT_THAT(refusal(named), AllOf(HasSubstr("6, 9 or 15"), HasSubstr("[1, 3, 8, 12]")));
  named.network.output = OutputKind::yolox;
  EXPECT_THAT(refusal(named), HasSubstr("output"));
  named = options(centres_net(48, 32), 48, 32);
  named.network.output = OutputKind::heatmaps;
  EXPECT_THAT(refusal(named), HasSubstr("heatmaps of 3 points"));
  named.network.output = OutputKind::mask;
  EXPECT_THAT(refusal(named), HasSubstr("a mask must have"));
  // A network for points without a layout.
  EXPECT_THAT(refusal(options(centres_net(48, 32), 48, 32), 0), HasSubstr("layout"));
  named = options(heatmap_net(48, 32, 4), 48, 32);
  named.network.outputs = {"nose"};
  EXPECT_THAT(refusal(named), AllOf(HasSubstr("nose"), HasSubstr("heatmaps")));
  // SimCC for an input of another size than the file says.
  EXPECT_THAT(refusal(options(heatmap_net(48, 32, 1, std::numeric_limits<float>::quiet_NaN()), 48, 32)),
              HasSubstr("not finite"));
}

TEST_F(Adapters, SurviveHostileFiles) {
  const auto look = [&](int width, int height, int points) {
    return [=, this](const std::filesystem::path& path) {
      PersonNetworkOptions all;
      all.network.model = path;
      all.network.input = {width, height};
      const auto person = find(all, cv::Mat(height, width, CV_8UC3, cv::Scalar::all(90)), points);
      for (const NetworkPoint& point : person ? person->points : std::vector<NetworkPoint>())
        EXPECT_TRUE(point.position.allFinite() && point.score <= 1.0);
    };
  };
  support::expect_survives_hostile_files(folder_ / "simcc.onnx", simcc_net(16, 24, 2), look(16, 24, 3), 20);
  support::expect_survives_hostile_files(folder_ / "points.onnx", centres_net(8, 8), look(8, 8, 3), 20);
  support::expect_survives_hostile_files(folder_ / "mask.onnx", class_net(16, 16, 2, {1, 2}, {0, 1}), look(16, 16, 0),
                                         20);
}

}  // namespace
}  // namespace doppel::output_adapter_test
