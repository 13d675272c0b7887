#pragma once

#include <torch/script.h>

#include <map>
#include <string>
#include <vector>

namespace doppel {

class QuantizedWeights;

struct OnnxSignature {
  std::vector<std::string> inputs;   ///< names, in the order of the method's arguments
  std::vector<std::string> outputs;  ///< names, in the order of the method's results
};

/// A method of a TorchScript module as an ONNX model (opset 17).
///
/// The method is evaluated operation by operation on two samples. What does not depend on the inputs becomes a
/// constant. Sizes that are equal in both samples are fixed in the model; sizes that differ follow the batch.
/// Operations that ONNX lacks are composed of others (atan2, cross products, inverses of 3 x 3 matrices, sums by
/// index); `conversion.h` has the table.
///
/// @param module   in evaluation mode. The method holds plain aten operations and no branches, as a trace does
/// @param samples  inputs with batch sizes (dimension 0) 1 and 2
/// @param metadata key-value pairs for the file
/// @param quantized null, or the parameters that are stored with fewer bits (export/quantized_weights.h), under their
/// names. A Cast, and with 8 bits a Mul by the scale, make float32 of them. ONNX Runtime computes such operators once,
/// when it loads the file. A DequantizeLinear would run again in each call, and has no scale for each node and channel.
/// @return the bytes of the file
/// @throws Error naming an operation that has no conversion
std::string onnx_model(const torch::jit::script::Module& module, const std::string& method,
                       const OnnxSignature& signature, const std::vector<torch::jit::Stack>& samples,
                       const std::map<std::string, std::string>& metadata, const QuantizedWeights* quantized = nullptr);

}  // namespace doppel
