#pragma once

#include <filesystem>

namespace doppel {

/// The hidden name beside `path` under which `write_atomically` writes: `.doppel-3f2a9c01-4711-0-report.html` for
/// `report.html`, with a mark of the machine, the number of the process and a count. Any thread may ask. The first
/// name in a folder that a process asks for calls remove_temporaries.
std::filesystem::path temporary_beside(const std::filesystem::path& path);

/// Flushes a complete temporary file to disk and renames it to `path`, which is then either the old or the new file,
/// also after a power failure. @throws Error naming `path` and the system's reason; the temporary file then stays
void publish_file(const std::filesystem::path& temporary, const std::filesystem::path& path);

/// Removes the temporary files that killed processes of this machine left in a folder, and no other file.
void remove_temporaries(const std::filesystem::path& folder);

}  // namespace doppel
