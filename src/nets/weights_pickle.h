#pragma once

/// The pickle inside a `.pth`: a program for a stack machine. Here it runs on a machine that knows only the
/// instructions and the three functions a mapping from names to tensors is written with; whatever else it asks for is
/// an error.

#include <cstdint>
#include <string>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

/// A tensor as the pickle describes it; its numbers are the record `data/<key>` of the archive.
struct PickledTensor {
  std::string name;
  std::string storage;  ///< type of the numbers: "FloatStorage", ...
  std::string key;
  std::int64_t offset = 0;  ///< of the first element, in elements
  std::vector<std::int64_t> shape, stride;
};

/// @param where for messages
/// @throws FileError: cut short, an instruction or function beyond those, or no mapping from names to tensors
std::vector<PickledTensor> read_pickled_tensors(const std::uint8_t* bytes, std::size_t size, const FileLocation& where);

}  // namespace doppel
