#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace doppel {

/// The hidden name beside `path` under which `write_atomically` writes: `.report.4711-0.html` for `report.html`, with
/// the number of the process and a count.
std::filesystem::path temporary_beside(const std::filesystem::path& path);

/// Flushes a complete temporary file to disk and renames it to `path`, which is then either the old or the new file,
/// also after a power failure. @throws Error naming `path` and the system's reason; the temporary file then stays
void publish_file(const std::filesystem::path& temporary, const std::filesystem::path& path);

/// Removes the temporary files that killed processes left in a folder, and no other file.
/// @param ours whether a file of this name is one that we write; only its temporary files are removed
void remove_temporaries(const std::filesystem::path& folder, const std::function<bool(const std::string&)>& ours);

}  // namespace doppel
