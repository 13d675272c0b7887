#pragma once

#include <filesystem>

#include "doppel/nets/weights/weights_file.h"

namespace doppel {

/// The constants of an ONNX model by name, as far as they are of type float32, float16 or int8 and stored as raw bytes,
/// as `onnx_model` writes them. @throws FileError when the file is not an ONNX model
NamedWeights read_onnx_constants(const std::filesystem::path& path);

}  // namespace doppel
