#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

/// An array of a `.npy` file in C order and little-endian: float32 (`<f4`), float64 (`<f8`), int32 (`<i4`), int64
/// (`<i8`) or uint8 (`|u1`).
struct NpyArray {
  std::string type;  ///< "<f4", "<f8", "<i4", "<i8" or "|u1"
  std::vector<std::int64_t> shape;
  std::vector<std::uint8_t> bytes;  ///< product(shape) * item size

  std::int64_t size() const;
  /// The elements converted to T. @throws Error when T is an integer type and the array holds floating-point numbers or
  /// a number that T cannot hold
  template <typename T>
  std::vector<T> as() const;
};

/// @throws FileError: not a .npy file, Fortran order, another type, a file too short for its shape, surplus bytes
NpyArray read_npy(const std::filesystem::path& path);
/// As read_npy, for the bytes of a `.npy` file in memory. @param where for messages: the file, and the part of it
NpyArray parse_npy(std::string_view content, const FileLocation& where);

/// The bytes of a `.npy` file (format version 1.0) for an array in memory.
std::string npy_bytes(const void* data, const std::string& type, const std::vector<std::int64_t>& shape);
/// Writes a float32 array atomically.
void write_npy(const std::filesystem::path& path, const float* data, const std::vector<std::int64_t>& shape);
void write_npy(const std::filesystem::path& path, const double* data, const std::vector<std::int64_t>& shape);

/// Reads an array of floating-point numbers item by item along its first axis, without holding the array in memory.
class NpyItems {
 public:
  /// @throws FileError as read_npy, and for another type than `<f4` and `<f8`
  explicit NpyItems(const std::filesystem::path& path);

  std::int64_t size() const { return shape_[0]; }  ///< items
  const std::vector<std::int64_t>& shape() const { return shape_; }
  /// The values of one item, of which each has the same number. @throws Error when there is no such item
  std::vector<float> read(std::int64_t item);

 private:
  std::filesystem::path path_;
  std::ifstream file_;
  std::string type_;
  std::vector<std::int64_t> shape_;
  std::streamoff begin_ = 0;
};

/// Writes a float32 array whose first axis grows frame by frame, without holding the array in memory.
class NpyStream {
 public:
  /// @param item_shape the shape of one item; the file's shape is [items, item_shape...]
  NpyStream(const std::filesystem::path& path, std::vector<std::int64_t> item_shape);
  ~NpyStream();
  NpyStream(const NpyStream&) = delete;
  NpyStream& operator=(const NpyStream&) = delete;

  /// @param item [item_shape...] @throws Error for another number of values, and when the disk is full
  void append(std::span<const float> item);
  /// Completes the header and moves the file to its path. Without this call no file remains.
  void close();

 private:
  std::filesystem::path path_, temporary_;
  std::vector<std::int64_t> item_shape_;
  std::int64_t items_ = 0, item_size_ = 1;
  std::FILE* file_ = nullptr;
};

}  // namespace doppel
