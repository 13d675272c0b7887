#pragma once

#include <filesystem>

namespace doppel {

/// Checks the tree of pages of an LMDB data file: that every page it reaches lies in the file, is of the right kind
/// and keeps its nodes within itself. LMDB trusts these numbers, so a damaged file would end the process instead of
/// giving an error. Reads the inner pages only; the values have checksums of their own.
/// @throws FileError saying what is damaged
void check_store_pages(const std::filesystem::path& data_file);

}  // namespace doppel
