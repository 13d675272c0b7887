#pragma once

namespace doppel {

/// A file of `configs`. The file is compiled in, so an installed program needs no data folder. The CMake function
/// doppel_builtin_files writes the tables.
struct BuiltinFile {
  const char* name;  ///< without the extension
  const char* text;
};

}  // namespace doppel
