#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace doppel {

/// Writes a file so that a reader sees either the old content or the whole new content, never a part. The content
/// goes into a temporary file beside `path`, which is flushed to disk and renamed to `path`. Missing folders are
/// created. If `write` throws, or the disk is full, the temporary file is removed and `path` stays as it was.
///
/// @param path   the file to write
/// @param write  called with the temporary file's path (same extension as `path`); must write and close it
/// @throws Error naming the path and the system's reason
void write_atomically(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& temporary)>& write);

/// As above, for content that is already in memory.
void write_atomically(const std::filesystem::path& path, const std::string& content);

/// Reads a whole file. @throws FileError when `path` is missing, a folder, or larger than `max_bytes`
std::string read_file(const std::filesystem::path& path, std::uintmax_t max_bytes = std::uintmax_t{1} << 32);

}  // namespace doppel
