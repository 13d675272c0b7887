#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

/// A property of a PLY element: a number, or a list of numbers.
struct PlyProperty {
  enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };
  std::string name;
  Type type = Type::float32;
  bool is_list = false;
  Type count_type = Type::uint8;  ///< of a list
};

/// A kind of rows: `vertex`, `face`, ...
struct PlyElement {
  std::string name;
  std::size_t count = 0;  ///< each row takes at least a byte of the file
  std::vector<PlyProperty> properties;
};

/// Bytes that a number of a type takes in a binary file.
std::size_t ply_size(PlyProperty::Type type);
bool ply_is_float(PlyProperty::Type type);

/// A PLY file: header, and the numbers of its body one after the other, as text or in either order of bytes.
class PlyFile {
 public:
  /// Reads the header. @throws FileError for a header that is none, or with counts that the file cannot hold
  explicit PlyFile(const std::filesystem::path& path);

  const std::vector<PlyElement>& elements() const { return elements_; }
  /// File names of comments `TextureFile ...`, in the order of the file.
  const std::vector<std::string>& textures() const { return textures_; }
  /// The next number of the body. @throws FileError at the end of the file, or for a text that is no number
  double next(PlyProperty::Type type);
  /// The next number as the length of a list. @throws FileError for more items than the rest of the file can hold
  std::size_t next_count(const PlyProperty& list);

  template <typename... Args>
  [[noreturn]] void fail_here(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at({path_.string(), 0}, format, std::forward<Args>(args)...);
  }

 private:
  void read_header();
  void read_header_line(const std::vector<std::string>& words, const std::string& line);
  void check_counts() const;
  double next_word();

  std::filesystem::path path_;
  std::string bytes_;
  std::size_t at_ = 0;
  bool text_ = false, big_endian_ = false, format_known_ = false;
  std::vector<PlyElement> elements_;
  std::vector<std::string> textures_;
};

}  // namespace doppel
