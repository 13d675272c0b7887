#pragma once

#include <filesystem>

namespace doppel {

/// Checks the page tree of an LMDB data file: every page of the tree must lie in the file, be of the right kind, and
/// contain its nodes. LMDB does not check these numbers, so a damaged file would crash the process. The
/// lists of free pages are checked too, because a writer uses these pages. Values are not read: they have their own
/// checksums.
/// @throws FileError that says what is damaged
void check_lmdb_file(const std::filesystem::path& data_file);

}  // namespace doppel
