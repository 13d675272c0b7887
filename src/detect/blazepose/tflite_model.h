#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "doppel/detect/blazepose/network_model.h"

namespace doppel {

/// Bytes of a file.
struct FilePart {
  std::uint64_t offset = 0, size = 0;
};

/// Reads a network in TensorFlow Lite's file format: one subgraph in float32, whose constants are float32 or float16,
/// dense or sparse (DENSIFY). Constants are converted to float32 here, so DEQUANTIZE and DENSIFY are not in the result.
/// All indices, shapes and sizes of the result are checked: `check_shapes` holds for it.
/// @param part the network in a file that holds several; nothing: the whole file
/// @throws FileError for another kind of file, a part beyond its end, one that is damaged or larger than 256 MB, an
/// operator or option that `NetworkOp` does not have (the message names it), and tensors that need more than 1 GB
/// together
NetworkModel read_tflite(const std::filesystem::path& path, const std::optional<FilePart>& part = std::nullopt);

}  // namespace doppel
