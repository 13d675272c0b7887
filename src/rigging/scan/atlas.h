#pragma once

#include <string>
#include <vector>

#include "doppel/rigging/scan/scan_parts.h"

namespace doppel {

struct AtlasOptions {
  int largest_size = 8192;  ///< pixels of the longer side of the atlas; textures are scaled down to fit
  int margin = 4;           ///< pixels around each texture, filled with its edge
  int most_repeats = 8;     ///< a texture that repeats more often along u or v is baked at a lower resolution
};

struct MergedScan {
  TriangleMesh mesh;               ///< all parts; one texture, or none if no part has one
  std::vector<int> first_face;     ///< [parts + 1] the faces of part p are first_face[p] .. first_face[p+1]
  std::vector<std::string> notes;  ///< what was baked, scaled or lost, in words
};

/// Joins the parts of a scan into one mesh with one texture. UVs beyond 0..1 repeat the texture: islands are moved by
/// whole tiles, and an island over several tiles gets a baked patch of repeated texture. A part without a texture takes
/// a plain patch of its colour; colours per vertex stay colours per vertex. Parts that share an image (the same pixels
/// in memory) share its position. If no part has a texture, the result has none.
/// @throws UsageError for no parts or wrong indices; when the total exceeds kMaxScanTriangles; for UVs that are not
/// finite
MergedScan merge_parts(const ScanParts& scan, const AtlasOptions& options = {});

}  // namespace doppel
