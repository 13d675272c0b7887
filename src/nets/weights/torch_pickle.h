#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
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

/// A mapping from names to tensors, texts and such mappings.
struct PickledDictionary {
  std::vector<PickledTensor> tensors;  ///< in the file's order
  std::map<std::string, std::string> texts;
  std::map<std::string, PickledDictionary> dictionaries;  ///< within them there are none
  std::vector<std::string> others;                        ///< names of values of other kinds, at most 5
};

/// Reads the pickle inside of a `.pth` or a checkpoint. It may call only the four functions that mappings from names to
/// tensors and texts need (core/pickle.h).
/// Memory and time are limited by the size of the pickle and by constants: at most two million values, a hundred
/// thousand tensors of at most 16 axes, and 64 MB of text in all.
/// @param where location of the pickle, for messages
/// @throws FileError: truncated, too large, a function that is not allowed, a name that occurs twice, a
/// dictionary that occurs twice, or no mapping
PickledDictionary read_torch_pickle(std::string_view bytes, const FileLocation& where);

}  // namespace doppel
