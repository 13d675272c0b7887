/// Layers of image networks.

#include "doppel/actor/onnx/conversion.h"

namespace doppel {
namespace {

std::vector<std::int64_t> twice(const std::vector<std::int64_t>& values) {
  std::vector<std::int64_t> all = values;
  all.insert(all.end(), values.begin(), values.end());
  return all;
}

/// Height and width; a single number counts for both.
std::vector<std::int64_t> pair(const OnnxOperation& o, std::size_t i) {
  const std::vector<std::int64_t> values = o.integers(i);
  return values.size() == 1 ? twice(values) : values;
}

/// _convolution(input, weight, bias, stride, padding, dilation, transposed, output_padding, groups, ...)
std::string convolution(const OnnxOperation& o) {
  OnnxAttributes attributes{
      {"strides", pair(o, 3)}, {"pads", twice(pair(o, 4))}, {"dilations", pair(o, 5)}, {"group", o.integer(8)}};
  std::vector<std::string> inputs{o.tensor(0), o.tensor(1)};
  if (!o.is_none(2)) inputs.push_back(o.tensor(2));
  if (!o.flag(6)) return o.graph.add("Conv", inputs, attributes);
  attributes.emplace_back("output_padding", pair(o, 7));
  return o.graph.add("ConvTranspose", inputs, attributes);
}

/// batch_norm(input, weight, bias, mean, variance, training, momentum, eps, ...) with the running statistics: a factor
/// and an offset for each channel.
std::string batch_norm(const OnnxOperation& o) {
  if (o.flag(5)) o.unsupported("takes the statistics of the batch");
  const torch::Tensor variance = o.constant(4).toTensor().to(torch::kFloat64);
  torch::Tensor factor = (variance + o.number(7)).rsqrt();
  if (!o.is_none(1)) factor = factor * o.constant(1).toTensor();
  torch::Tensor offset = -factor * o.constant(3).toTensor();
  if (!o.is_none(2)) offset = offset + o.constant(2).toTensor();
  std::vector<std::int64_t> sizes(o.sizes(0).size() - 1, 1);
  sizes.at(0) = -1;
  const auto by_channel = [&](const torch::Tensor& t) { return o.graph.constant(t.view(sizes).to(o.result_type())); };
  return o.graph.add("Add", {o.graph.add("Mul", {o.tensor(0), by_channel(factor)}), by_channel(offset)});
}

/// upsample(input, size, align_corners, factors), upsample(input, size, factors) for the nearest pixel
std::string upsample(const OnnxOperation& o, const std::string& mode, bool align_corners) {
  std::vector<std::int64_t> sizes = o.result_sizes();
  const std::string shape = o.graph.add("Shape", {o.tensor(0)}, {{"end", std::int64_t{2}}});
  const std::string all =
      o.graph.add("Concat", {shape, o.graph.integers({sizes.at(2), sizes.at(3)})}, {{"axis", std::int64_t{0}}});
  OnnxAttributes attributes{{"mode", mode},
                            {"coordinate_transformation_mode", std::string(mode == "nearest" ? "asymmetric"
                                                                           : align_corners   ? "align_corners"
                                                                                             : "half_pixel")}};
  if (mode == "nearest") attributes.emplace_back("nearest_mode", std::string("floor"));
  return o.graph.add("Resize", {o.tensor(0), "", "", all}, attributes);
}

std::string bilinear(const OnnxOperation& o) { return upsample(o, "linear", o.flag(2)); }
std::string nearest(const OnnxOperation& o) { return upsample(o, "nearest", false); }

/// max_pool2d(input, kernel, stride, padding, dilation, ceil_mode)
std::string max_pool(const OnnxOperation& o) {
  const std::vector<std::int64_t> kernel = pair(o, 1);
  return o.graph.add("MaxPool", {o.tensor(0)},
                     {{"kernel_shape", kernel},
                      {"strides", o.integers(2).empty() ? kernel : pair(o, 2)},
                      {"pads", twice(pair(o, 3))},
                      {"dilations", pair(o, 4)},
                      {"ceil_mode", std::int64_t{o.flag(5)}}});
}

std::string pixel_shuffle(const OnnxOperation& o) {
  return o.graph.add("DepthToSpace", {o.tensor(0)}, {{"blocksize", o.integer(1)}, {"mode", std::string("CRD")}});
}

std::string global_average(const OnnxOperation& o) {
  if (o.integers(1) != std::vector<std::int64_t>{1, 1}) o.unsupported("averages into several cells");
  return o.graph.add("GlobalAveragePool", {o.tensor(0)});
}

}  // namespace

const OnnxConversionTable& network_conversions() {
  static const OnnxConversionTable table{{"aten::_convolution", convolution},
                                         {"aten::batch_norm", batch_norm},
                                         {"aten::upsample_bilinear2d", bilinear},
                                         {"aten::upsample_nearest2d", nearest},
                                         {"aten::max_pool2d", max_pool},
                                         {"aten::pixel_shuffle", pixel_shuffle},
                                         {"aten::adaptive_avg_pool2d", global_average}};
  return table;
}

}  // namespace doppel
