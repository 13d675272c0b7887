#pragma once

#include <filesystem>
#include <string>

namespace doppel {

/// What a Collada file states for all of it.
struct ColladaAsset {
  double metres_per_unit = 1.0;
  char up = 'y';  ///< x, y or z
};
/// The first `<unit>` and `<up_axis>`; what is missing or no length has Collada's default.
ColladaAsset collada_asset(const std::string& text);

/// Refuses a Collada file that assimp 5.2 would read beyond its arrays, for ever, or with unbounded memory or stack:
/// nested elements (it recurses), counts (it reserves memory), accessors beyond their array, indices of skins beyond
/// their joints and weights, and lists of indices with other bytes than digits.
/// @throws FileError that names the fault
void refuse_what_assimp_trusts(const std::filesystem::path& path, const std::string& text);

}  // namespace doppel
