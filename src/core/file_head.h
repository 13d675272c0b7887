#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace doppel {

/// The first `bytes` bytes of a file, by which readers recognise its format. Empty for what cannot be read and for what
/// is no regular file: reading from a pipe or a device might never end.
std::string read_head(const std::filesystem::path& path, std::size_t bytes);

}  // namespace doppel
