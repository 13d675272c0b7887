#pragma once

#include <filesystem>
#include <string>

namespace doppel {

/// Refuses a Collada file that assimp 5.2 would read beyond its arrays, for ever, or with unbounded memory or stack:
/// nested elements (it recurses), counts (it reserves memory), accessors beyond their array, indices of skins beyond
/// their joints and weights, and lists of indices with other bytes than digits.
/// @throws FileError that names the fault
void refuse_what_assimp_trusts(const std::filesystem::path& path, const std::string& text);

}  // namespace doppel
