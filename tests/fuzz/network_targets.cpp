#include "detect/blazepose/small_model.h"
#include "doppel/core/as_size.h"
#include "doppel/detect/blazepose/network_shapes.h"
#include "doppel/detect/blazepose/tflite_model.h"
#include "doppel/detect/networks/network_config.h"
#include "doppel/detect/networks/onnx_edits.h"
#include "doppel/detect/networks/onnx_message.h"
#include "fuzz/fuzz_target.h"
#include "support/onnx_file.h"

namespace doppel::fuzz {
namespace {

using Path = std::filesystem::path;
using support::OnnxFile;

constexpr std::size_t kMaxAddedBytes = std::size_t{41} << 20;  ///< bytes that edits may add to a network

void read_tflite_bytes(std::string_view bytes, const Path& folder) {
  const NetworkModel model = read_tflite(written(bytes, folder, "a.tflite"));
  const auto is_tensor = [&](int index) { return index >= 0 && as_size(index) < model.tensors.size(); };
  promise(!model.operators.empty() && !model.inputs.empty() && !model.outputs.empty(), "a network computes something");
  for (const NetworkTensor& tensor : model.tensors)
    promise(!tensor.values || static_cast<std::int64_t>(tensor.values->size()) == num_elements(tensor.shape),
            "constants have the numbers of their shape");
  for (const NetworkOperator& step : model.operators) {
    promise(is_tensor(step.output) && !model.tensors[step.output].values, "results are tensors");
    for (const int input : step.inputs) promise(is_tensor(input), "inputs are tensors");
  }
  for (const int index : model.inputs) promise(is_tensor(index), "inputs of the network are tensors");
  for (const int index : model.outputs) promise(is_tensor(index), "outputs of the network are tensors");
  check_shapes(model);
}

/// Only an edit that needs a constant reads its packed numbers, so damage there is no matter for the others.
std::optional<onnx::Tensor> readable_tensor(std::string_view message) {
  try {
    return onnx::read_tensor(message);
  } catch (const onnx::NoMessage&) {
    return std::nullopt;
  }
}

/// Nodes and constants survive writing and reading.
void check_onnx_parts(std::string_view bytes) {
  for (const onnx::Field& part : onnx::fields_of(bytes)) {
    if (part.id != onnx::kGraph || !part.has_bytes) continue;
    for (const onnx::Field& field : onnx::fields_of(part.bytes)) {
      if (field.id == onnx::kNode) {
        const onnx::Node node = onnx::read_node(field.bytes), again = onnx::read_node(onnx::write_node(node));
        promise(again.type == node.type && again.inputs == node.inputs && again.attributes == node.attributes,
                "operators survive");
      }
      const auto tensor = field.id == onnx::kInitializer ? readable_tensor(field.bytes) : std::nullopt;
      if (!tensor) continue;
      promise(tensor->floats.empty() || tensor->integers.empty(), "a constant has numbers of one type");
      const auto again = onnx::read_tensor(onnx::write_tensor("a", *tensor));
      promise(again && again->dims == tensor->dims && again->integers == tensor->integers, "constants survive");
    }
  }
}

void edit_onnx_bytes(std::string_view bytes, const Path& /*folder*/) {
  const std::string edited = readable_onnx(std::string(bytes));
  promise(edited.size() <= bytes.size() * 2 + kMaxAddedBytes, "edits add little");
  try {
    check_onnx_parts(bytes);
  } catch (const onnx::NoMessage&) {
    promise(edited == bytes, "what is no network stays as it is");
    return;
  }
  try {
    check_onnx_parts(edited);
  } catch (const onnx::NoMessage&) {
    promise(edited == bytes, "an edited network can be read");
  }
}

void read_network_bytes(std::string_view bytes, const Path& folder) {
  const PersonNetworkOptions options = load_person_network(spread(bytes, folder, {"a.yaml", "b.yaml"}).string());
  const auto text_of = [](const PersonNetworkOptions& read) {
    YAML::Emitter text;
    text << person_network_node(read);
    return std::string(text.c_str());
  };
  const std::string text = text_of(options);
  promise(text_of(load_person_network(written(text, folder, "again.yaml").string())) == text, "options survive");
}

/// A network with all that is edited: `Clip` with limits, `Mul` with a row, and `Mul` with rows behind `Unsqueeze`.
std::string small_onnx() {
  OnnxFile net;
  net.input("image", {1, 3, 2}).output("out", {1, 3, 2, 2});
  net.floats("row", {2}, {0.5F, 2.0F}).floats("rows", {1, 2, 2}, {1, 2, 3, 4}).floats("low", {}, {-1.0F});
  net.number_node("high", 6.0F);
  net.node("Clip", {"image", "low", "high"}, {"clipped"}).node("Mul", {"clipped", "row"}, {"scaled"});
  net.node("Unsqueeze", {"scaled"}, {"wide"}, {OnnxFile::ints("axes", {1})}).node("Mul", {"wide", "rows"}, {"out"});
  return net.bytes();
}

constexpr const char* kNetwork =
    "model: a.onnx\ninput: [192, 256]\nrgb: true\nmean: [123.7, 116.3, 103.5]\nscale: 0.0171\n"
    "crop: {padding: 1.25, boxes: {model: b.onnx, input: [416, 416]}}\n";

}  // namespace

std::vector<FuzzTarget> network_targets() {
  return {
      {"tflite",
       read_tflite_bytes,
       {support::mixed_network(), support::mean_and_product_network()},
       {"TFL3", std::string("\0\0\0\0", 4), "\xff\xff\xff\x7f", "\x01\x01\x01\x01"}},
      {"onnx",
       edit_onnx_bytes,
       {small_onnx()},
       {"Clip", "Mul", "Unsqueeze", "Constant", "axes", "row", "rows", "\x08\x02",
        "\x80\x80\x80\x80\x80\x80\x80\x80\x80\x01", "\x3a", "\x2a", "\x0a"},
       unwrap_protobuf},
      {"network_config",
       read_network_bytes,
       {joined({kNetwork, "config: rtmpose\nmodel: c.onnx\n"}), joined({"config: b.yaml\n", kNetwork})},
       {"config: rtmpose", "config: yolox", "config: a.yaml", "config: b.yaml", kNextFile, "model: ", "crop:", "boxes:",
        "mask:",           "output:",       "points",         "heatmaps",       "simcc",   "&a ",     "*a",    "null",
        "1e308",           "[1, 1]",        "stages:",        "scale: 0"}}};
}

}  // namespace doppel::fuzz
