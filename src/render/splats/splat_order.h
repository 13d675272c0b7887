#pragma once

#include <cstdint>
#include <vector>

#include "doppel/render/splats/splat_kernel.h"

namespace doppel::splats {

/// Indices of the keys other than kHiddenSplat, in ascending order of the keys; equal keys: in ascending order of the
/// indices.
class KeySort {
 public:
  const std::vector<std::int32_t>& sort(const std::uint32_t* keys, std::int64_t count);

 private:
  std::vector<std::uint32_t> keys_, other_keys_;
  std::vector<std::int32_t> order_, other_order_;
};

/// The tiles of an image of W x H pixels, row by row.
struct TileGrid {
  std::int64_t width, height;
  std::int64_t columns() const { return (width + kernels::kSplatTileWidth - 1) / kernels::kSplatTileWidth; }
  std::int64_t rows() const { return (height + kernels::kSplatTileHeight - 1) / kernels::kSplatTileHeight; }
  std::int64_t tiles() const { return columns() * rows(); }
};

/// The number of tiles that each record touches, added up. @param first [M+1], of which first[M] is the number of pairs
void count_slots(const kernels::SplatRecord* records, std::int64_t count, std::int32_t* first);
/// Pairs of all tiles, tile by tile, the nearest record first. @param offsets [tiles+1] where each tile begins
void fill_tiles(const kernels::SplatRecord* records, std::int64_t count, const std::int32_t* first,
                const TileGrid& grid, std::int32_t* offsets, kernels::SplatPair* pairs);

}  // namespace doppel::splats
