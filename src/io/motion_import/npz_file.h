#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "doppel/core/npy.h"

namespace doppel {

/// The arrays of a `.npz` file of NumPy: a zip archive of `.npy` files, stored or deflated. The central directory at
/// the end of the archive says where they are. An array is unpacked when it is read.
class NpzFile {
 public:
  /// @throws FileError: not a zip archive, truncated, encrypted, in several volumes, larger than 4 GiB
  explicit NpzFile(const std::filesystem::path& path);

  std::vector<std::string> names() const;  ///< of the arrays, without `.npy`
  bool has(const std::string& name) const { return entries_.count(name) != 0; }
  /// @throws FileError for an array that the file does not have, is damaged, is packed by another method, or unpacks to
  ///   more than 512 MiB; as parse_npy
  NpyArray read(const std::string& name) const;
  const FileLocation& where() const { return where_; }

 private:
  struct Entry {
    int flags = 0, method = 0;
    std::size_t crc = 0, packed = 0, unpacked = 0;  ///< the sizes in bytes
    std::size_t begin = 0;                          ///< of the local header
  };
  void read_directory();
  Entry read_entry(std::size_t at) const;
  std::string_view packed_bytes(const Entry& entry) const;
  std::string unpack(const Entry& entry, const FileLocation& where) const;
  std::size_t number(std::size_t at, std::size_t bytes) const;

  FileLocation where_;
  std::string bytes_;
  std::map<std::string, Entry> entries_;
};

}  // namespace doppel
