#pragma once

/// The pickle inside a `.pth` is a program for a stack machine. This interpreter supports only the instructions and the
/// three functions that a mapping from names to tensors needs; everything else is an error.

#include <cstdint>
#include <string>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

/// The description of a tensor in the pickle. Its numbers are the record `data/<key>` of the archive.
struct PickledTensor {
  std::string name;
  std::string storage;  ///< type of the numbers: "FloatStorage", ...
  std::string key;
  std::int64_t offset = 0;  ///< of the first element, in elements
  std::vector<std::int64_t> shape, stride;
};

/// @param where location of the pickle, for messages
/// @throws FileError: truncated, an unsupported instruction or function, or not a mapping from names to tensors
std::vector<PickledTensor> read_pickled_tensors(const std::uint8_t* bytes, std::size_t size, const FileLocation& where);

}  // namespace doppel
