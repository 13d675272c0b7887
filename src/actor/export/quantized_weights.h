#pragma once

#include <torch/types.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <unordered_map>
#include <vector>

#include "doppel/actor/export/script_file.h"
#include "doppel/nets/weights/weights_file.h"

namespace doppel {

/// Weights of networks in 16 or 8 bits, for smaller files. A host makes float32 of them when it loads the file, and
/// computes as without quantization.
///
/// - 16 bits: `values` is float16, which keeps 11 significant bits. weight = values
/// - 8 bits: `values` is int8 with a scale for each output channel. weight = values * scale,
///   scale = (largest |weight| of the channel) / 127. No weight is off by more than scale / 2.
///
/// Only the kernels of convolutions and the matrices of linear layers are quantized. They take most of a file, and
/// each result is a sum over many of them, in which their rounding errors, of both signs, largely cancel. All else
/// stays as it is: biases and norms are small, and an error in one of them moves a whole channel; lengths (template,
/// skeleton, offsets and sizes of Gaussians), skinning weights, indices and the static texture go into the result
/// without such a sum.
struct QuantizedWeight {
  std::string name;         ///< as in the file: "egnet.sagcn.stem.kernels"
  torch::Tensor parameter;  ///< the weight of the network, float32
  torch::Tensor values;     ///< float16 or int8, in the shape of the weight
  torch::Tensor scale;  ///< 8 bits: float32, of the shape of the weight with size 1 along the inputs; else undefined

  std::string scale_name() const { return name + ".scale"; }
};

/// @param channels with 8 bits, the axes of the weight that count its output channels, each with a scale of its own
/// @throws UsageError for other `bits` than 8 and 16; Error when a weight is not finite, or too large for float16
QuantizedWeight quantized_weight(const std::string& name, const torch::Tensor& weight,
                                 const std::vector<std::int64_t>& channels, int bits);
/// The weight that a host computes with, float32. @param scale undefined: 1
torch::Tensor dequantized(const torch::Tensor& values, const torch::Tensor& scale);

/// A weight as read from a file.
struct StoredWeight {
  torch::Tensor parameter;  ///< the weight of the network
  torch::Tensor weight;     ///< what the file has in its place, dequantized
  std::int64_t bytes = 0;   ///< that it takes in the file
};

/// All weights of an actor that are quantized, or none. Files keep them under the names of the parameters, and the
/// scale of NAME as NAME.scale.
class QuantizedWeights {
 public:
  QuantizedWeights() = default;  ///< none: files are written as they are
  /// @param modules networks by the first part of the names of their parameters @throws as quantized_weight
  QuantizedWeights(const ScriptModules& modules, int bits);

  int bits() const { return bits_; }  ///< 16, 8, or 0 for none
  const std::vector<QuantizedWeight>& all() const { return all_; }
  /// How a file should store a tensor of a network; null: as it is. The tensor may be another handle of the parameter.
  const QuantizedWeight* find(const torch::Tensor& tensor) const;
  /// For the metadata of files: bits, and the rule that gives the weights.
  nlohmann::ordered_json metadata() const;
  /// The quantized weights among the tensors of a file. A host reads them in the same way.
  /// @throws Error when a scale is missing, or a shape is another than that of the network
  std::vector<StoredWeight> stored(const NamedWeights& file) const;

 private:
  int bits_ = 0;
  std::vector<QuantizedWeight> all_;
  std::unordered_map<const void*, std::size_t> by_data_;  ///< first number of a parameter -> index in all_
};

}  // namespace doppel
