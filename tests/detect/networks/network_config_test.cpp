#include "doppel/detect/networks/network_config.h"

#include <gmock/gmock.h>

#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::network_config_test {
namespace {

using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

PersonNetworkOptions read(const std::string& text) {
  const ConfigDocument document = ConfigDocument::parse(text, "net.yaml");
  const ConfigReader root = document.root();
  PersonNetworkOptions options = read_person_network(root);
  root.finish();
  return options;
}

std::string refusal(const std::string& text) {
  const std::string message = message_of<Error>([&] { read(text); });
  EXPECT_THAT(message, HasSubstr("net.yaml:")) << text;
  return message;
}

TEST(NetworkConfig, TheKeysOfBeforeMeanTheSame) {
  const PersonNetworkOptions options = read(
      "model: pose.prototxt\nweights: pose.caffemodel\ninput_height: 256\nscale: 0.5\nmean: [104, 117, 123]\n"
      "rgb: true\nthreshold: 0.2\n");
  EXPECT_EQ(options.network.weights, "pose.caffemodel");
  EXPECT_TRUE(options.network.input.empty());
  EXPECT_EQ(options.network.input_height, 256);
  EXPECT_EQ(options.network.mean, (std::array<double, 3>{104, 117, 123}));
  EXPECT_EQ(options.network.deviation, (std::array<double, 3>{2, 2, 2})) << "value = (colour - mean) * scale";
  EXPECT_TRUE(options.network.rgb);
  EXPECT_EQ(options.network.threshold, 0.2);
  EXPECT_FALSE(options.crop || options.mask);
}

TEST(NetworkConfig, MeanAndDeviationOfColoursUpToOne) {
  const PersonNetworkOptions options =
      read("model: a.onnx\nrange: 1\nmean: [0.485, 0.456, 0.406]\ndeviation: [0.229, 0.224, 0.225]\n");
  for (const auto& [found, expected] : {std::pair(options.network.mean[0], 123.675),
                                        {options.network.mean[2], 103.53},
                                        {options.network.deviation[0], 58.395},
                                        {options.network.deviation[1], 57.12}})
    EXPECT_NEAR(found, expected, 1e-9);
}

TEST(NetworkConfig, TheFormsOfPublicNetworksAreBuiltIn) {
  for (const std::string& name : builtin_network_configs())
    EXPECT_FALSE(load_person_network(name).network.input.empty());
  const PersonNetworkOptions options = read(
      "config: rtmpose\nmodel: rtmpose-m.onnx\ninput: [288, 384]\n"
      "crop: {boxes: {config: yolox, model: yolox_tiny.onnx, input: [416, 416]}}\n");
  EXPECT_EQ(options.network.output, OutputKind::simcc);
  EXPECT_EQ(options.network.input, cv::Size(288, 384));
  EXPECT_DOUBLE_EQ(options.network.mean[0], 123.675);
  EXPECT_DOUBLE_EQ(options.network.deviation[2], 57.375);
  EXPECT_TRUE(options.network.rgb);
  ASSERT_TRUE(options.crop && options.crop->boxes);
  EXPECT_EQ(options.crop->padding, 1.25);
  EXPECT_EQ(options.crop->boxes->output, OutputKind::yolox);
  EXPECT_EQ(options.crop->boxes->border, 114.0);
  EXPECT_EQ(options.crop->boxes->input, cv::Size(416, 416));
  EXPECT_DOUBLE_EQ(options.crop->boxes->deviation[1], 1.0);
  EXPECT_EQ(load_person_network("vitpose").network.grid, OutputGrid::ends);
  EXPECT_EQ(load_person_network("hrnet").network.grid, OutputGrid::samples);
}

TEST(NetworkConfig, AFileNamesModelsBesideIt) {
  const support::TemporaryFolder folder;
  support::write_bytes(folder / "net.yaml", "config: hrnet\nmodel: weights/w32.onnx\nmask: {model: matting.onnx}\n");
  const PersonNetworkOptions options = load_person_network((folder / "net.yaml").string());
  EXPECT_EQ(options.network.model, folder / "weights/w32.onnx");
  ASSERT_TRUE(options.mask);
  EXPECT_EQ(options.mask->model, folder / "matting.onnx");
  EXPECT_EQ(options.network.refine, PeakRefinement::quarter);
  EXPECT_THAT(message_of<UsageError>([&] { load_person_network("resnet"); }),
              AllOf(HasSubstr("resnet"), HasSubstr("rtmpose")));
  support::write_bytes(folder / "net.yaml", "config: net.yaml\nmodel: a.onnx\n");
  EXPECT_THAT(message_of<Error>([&] { load_person_network((folder / "net.yaml").string()); }),
              HasSubstr("names the file itself"));
}

TEST(NetworkConfig, WritingAndReadingGivesTheSame) {
  const PersonNetworkOptions options = read(
      "model: a.onnx\ninput: [192, 256]\nfit: letterbox\nborder: 9\nmean: [1, 2, 3]\ndeviation: [4, 5, 6]\n"
      "output: points\noutputs: [a, b]\nthreshold: 0.25\ngrid: samples\nrefine: dark\nblur: 7\nunits: fractions\n"
      "values: [y, x, logit]\nactivation: none\nperson: 4\n"
      "crop: {padding: 1.5, track: false, boxes: {model: b.onnx, output: ssd}}\nmask: {model: c.onnx, person: 15}\n");
  YAML::Emitter text;
  text << person_network_node(options);
  const PersonNetworkOptions again = read(text.c_str());
  YAML::Emitter second;
  second << person_network_node(again);
  EXPECT_STREQ(text.c_str(), second.c_str());
  EXPECT_EQ(again.network.values, options.network.values);
  EXPECT_EQ(again.network.deviation, options.network.deviation);
  EXPECT_EQ(again.network.blur, 7);
  EXPECT_EQ(again.network.person, 4);
  EXPECT_TRUE(again.network.fractions && again.network.letterbox);
  EXPECT_FALSE(again.crop->track);
  EXPECT_EQ(again.crop->boxes->output, OutputKind::ssd);
  EXPECT_TRUE(again.crop->boxes->letterbox) << "usual for boxes";
  EXPECT_EQ(again.mask->person, 15);
}

TEST(NetworkConfig, ErrorsNameTheLine) {
  EXPECT_THAT(refusal("rgb: true\n"), HasSubstr("model"));
  EXPECT_THAT(refusal("model: a.onnx\ninput: [192]\n"), AllOf(HasSubstr("net.yaml:2"), HasSubstr("input")));
  EXPECT_THAT(refusal("model: a.onnx\ninput: [192, 256]\ninput_height: 256\n"), HasSubstr("excludes `input_height`"));
  EXPECT_THAT(refusal("model: a.onnx\nmean: [1, 2]\n"), AllOf(HasSubstr("net.yaml:2"), HasSubstr("three numbers")));
  EXPECT_THAT(refusal("model: a.onnx\ndeviation: [1, 0, 2]\n"), HasSubstr("positive"));
  EXPECT_THAT(refusal("model: a.onnx\nscale: 1\ndeviation: [1, 1, 2]\n"),
              AllOf(HasSubstr("net.yaml:3"), HasSubstr("scale")));
  EXPECT_THAT(refusal("model: a.onnx\nrange: 7\ndeviation: [1, 1, 2]\n"), HasSubstr("1 or 255"));
  EXPECT_THAT(refusal("model: a.onnx\noutput: simc\n"), AllOf(HasSubstr("net.yaml:2"), HasSubstr("simcc")));
  EXPECT_THAT(refusal("model: a.onnx\nrefine: parabel\n"), HasSubstr("parabola"));
  EXPECT_THAT(refusal("model: a.onnx\nblur: 4\n"), HasSubstr("odd"));
  EXPECT_THAT(refusal("model: a.onnx\nvalues: [x, z]\n"), AllOf(HasSubstr("'z'"), HasSubstr("skip")));
  EXPECT_THAT(refusal("model: a.onnx\ncrop: {padding: 1.1}\n"), AllOf(HasSubstr("net.yaml:2"), HasSubstr("input")));
  EXPECT_THAT(refusal("model: a.onnx\ninput: [64, 64]\ncrop:\n  boxes: {output: ssd}\n"),
              AllOf(HasSubstr("net.yaml:4"), HasSubstr("model")));
  EXPECT_THAT(refusal("model: a.onnx\nmask: {model: b.onnx, persn: 3}\n"), HasSubstr("person"));
  EXPECT_THAT(refusal("model: a.onnx\nconfig: rtmpos\n"), AllOf(HasSubstr("net.yaml:2"), HasSubstr("rtmpose")));
}

}  // namespace
}  // namespace doppel::network_config_test
