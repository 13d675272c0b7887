#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

struct StorageMember;

/// A value of a file in the layout of OpenCV's FileStorage. A file is a mapping.
struct StorageValue {
  enum class Kind { none, integer, real, text, list, mapping };

  Kind kind = Kind::none;
  double number = 0;
  std::string text;                    ///< of a number as it is written
  std::vector<StorageValue> items;     ///< of a list
  std::vector<StorageMember> members;  ///< of a mapping, in the file's order

  bool is_none() const { return kind == Kind::none; }
  bool is_number() const { return kind == Kind::integer || kind == Kind::real; }
  bool is_mapping() const { return kind == Kind::mapping; }
  /// The member of that name; the value `none` if there is none, and for other kinds.
  const StorageValue& operator[](std::string_view key) const;
  /// The numbers of a matrix (a mapping with rows, cols and data), of a list, or of one number.
  /// @param what the name of the value, for messages
  /// @throws FileError when it holds something else, NaN or infinity, or not rows x cols numbers
  std::vector<double> numbers(const std::string& what, const FileLocation& where) const;
};

/// A value and its name.
struct StorageMember {
  std::string name;
  StorageValue value;
};

/// Reads YAML, JSON or XML of FileStorage. OpenCV's own parsers call themselves for each level, and 250 bytes can keep
/// them busy for seconds.
/// @throws FileError for files that cannot be read, are larger than 64 MB, no text, damaged, or nested too deeply
StorageValue read_file_storage(const std::filesystem::path& path);

}  // namespace doppel
