#include "doppel/actor/export/quantized_weights.h"

#include <fmt/ranges.h>
#include <torch/nn/modules/conv.h>
#include <torch/nn/modules/linear.h>

#include <algorithm>
#include <map>
#include <optional>

#include "doppel/core/error.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"
#include "doppel/nets/ablation_nets.h"
#include "doppel/nets/sagcn.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr double kMaxInteger = 127.0;

/// The weight of a layer that is quantized, and the axes of its output channels.
struct LayerWeight {
  std::string name;
  Tensor weight;
  std::vector<std::int64_t> channels;
};

std::optional<LayerWeight> weight_of(const torch::nn::Module& layer) {
  if (const auto* linear = dynamic_cast<const torch::nn::LinearImpl*>(&layer))
    return LayerWeight{"weight", linear->weight, {0}};
  if (const auto* convolution = dynamic_cast<const torch::nn::Conv2dImpl*>(&layer))
    return LayerWeight{"weight", convolution->weight, {0}};
  if (const auto* transposed = dynamic_cast<const torch::nn::ConvTranspose2dImpl*>(&layer))
    return LayerWeight{"weight", transposed->weight, {1}};
  if (const auto* graph = dynamic_cast<const GraphConvolutionImpl*>(&layer))
    return LayerWeight{"kernels", graph->kernels, {0, 2}};  // [K,Hin,Hout]: each node has channels of its own
  if (const auto* dense = dynamic_cast<const DenseUnitImpl*>(&layer))
    return LayerWeight{
        "kernels", dense->kernels,
        dense->kind() == DenseBlock::matrix ? std::vector<std::int64_t>{0} : std::vector<std::int64_t>{0, 2}};
  if (const auto* chebyshev = dynamic_cast<const ChebyshevConvolutionImpl*>(&layer))
    return LayerWeight{"weight", chebyshev->weight, {2}};
  return std::nullopt;
}

/// The largest |weight| of each channel over kMaxInteger.
Tensor scale_of(const Tensor& weight, const std::vector<std::int64_t>& channels) {
  std::vector<std::int64_t> inputs;
  for (std::int64_t axis = 0; axis < weight.dim(); ++axis)
    if (std::find(channels.begin(), channels.end(), axis) == channels.end()) inputs.push_back(axis);
  return weight.abs().amax(inputs, /*keepdim=*/true) / kMaxInteger;
}

}  // namespace

QuantizedWeight quantized_weight(const std::string& name, const Tensor& weight,
                                 const std::vector<std::int64_t>& channels, int bits) {
  if (bits != 8 && bits != 16) fail<UsageError>("quantizing {}: found {} bits, allowed are 8 and 16", name, bits);
  QuantizedWeight result{name, weight, {}, {}};
  const Tensor numbers = weight.detach();
  if (bits == 16) {
    result.values = numbers.to(torch::kFloat16);
  } else {
    result.scale = scale_of(numbers, channels);
    const Tensor divisor = torch::where(result.scale > 0, result.scale, torch::ones_like(result.scale));
    result.values = (numbers / divisor).round().clamp(-kMaxInteger, kMaxInteger).to(torch::kInt8);
  }
  if (!dequantized(result.values, result.scale).isfinite().all().item<bool>())
    fail("quantizing {}: its largest weight is {:.3g}; finite weights are allowed, with 16 bits up to 65504. {}", name,
         numbers.abs().max().item<double>(),
         numbers.isfinite().all().item<bool>() ? "Export with --quantize 8, or without"
                                               : "Train the run again: its network is damaged");
  return result;
}

Tensor dequantized(const Tensor& values, const Tensor& scale) {
  const Tensor numbers = values.to(torch::kFloat32);
  return scale.defined() ? numbers * scale : numbers;
}

QuantizedWeights::QuantizedWeights(const ScriptModules& modules, int bits) : bits_(bits) {
  for (const auto& [prefix, network] : modules)
    for (const auto& layer : network->named_modules(prefix, /*include_self=*/false)) {
      const std::optional<LayerWeight> found = weight_of(*layer.value());
      if (!found) continue;
      by_data_[found->weight.data_ptr()] = all_.size();
      all_.push_back(quantized_weight(layer.key() + "." + found->name, found->weight, found->channels, bits));
    }
}

const QuantizedWeight* QuantizedWeights::find(const Tensor& tensor) const {
  if (all_.empty() || !tensor.defined()) return nullptr;
  const auto found = by_data_.find(tensor.data_ptr());
  if (found == by_data_.end() || all_[found->second].parameter.sizes() != tensor.sizes()) return nullptr;
  return &all_[found->second];
}

nlohmann::ordered_json QuantizedWeights::metadata() const {
  return {{"bits", bits_},
          {"weights", bits_ == 8 ? "tensors of type int8: the weight is NAME * NAME.scale, float32"
                                 : "tensors of type float16: the weight is NAME as float32"}};
}

std::vector<StoredWeight> QuantizedWeights::stored(const NamedWeights& file) const {
  std::map<std::string, Tensor> tensors(file.begin(), file.end());
  std::vector<StoredWeight> found;
  for (const QuantizedWeight& weight : all_) {
    const auto values = tensors.find(weight.name);
    if (values == tensors.end()) continue;
    const Tensor scale = weight.scale.defined() ? tensors[weight.scale_name()] : Tensor();
    if (weight.scale.defined() && !scale.defined())
      fail("reading quantized weights: found {} without {}; export the run again", weight.name, weight.scale_name());
    const Tensor numbers = dequantized(values->second, scale);
    if (numbers.sizes() != weight.parameter.sizes())
      fail("reading quantized weights: {} is [{}], the network's is [{}]; export the run again", weight.name,
           fmt::join(numbers.sizes(), ","), fmt::join(weight.parameter.sizes(), ","));
    found.push_back({weight.parameter, numbers,
                     static_cast<std::int64_t>(values->second.nbytes() + (scale.defined() ? scale.nbytes() : 0))});
  }
  return found;
}

}  // namespace doppel
