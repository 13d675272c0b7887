#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "doppel/render/splats/splat_kernel.h"

namespace doppel::splats {

/// The tiles of an image of W x H pixels, row by row.
struct TileGrid {
  std::int64_t width, height;
  std::int64_t columns() const { return (width + kernels::kSplatTileWidth - 1) / kernels::kSplatTileWidth; }
  std::int64_t rows() const { return (height + kernels::kSplatTileHeight - 1) / kernels::kSplatTileHeight; }
  std::int64_t tiles() const { return columns() * rows(); }
};

/// Counts the copies of N records, one for each tile that a record touches. Those with the key kHiddenSplat have none.
/// @param first [N+1] record n has the copies first[n] to first[n+1] @param offsets [tiles+1] the first copy of each
/// tile
void count_copies(std::span<const kernels::SplatRecord> records, const TileGrid& grid, std::int32_t* first,
                  std::int32_t* offsets);
/// A copy of a record in a tile.
struct TileEntry {
  std::uint32_t key;    ///< of the record
  std::int32_t record;  ///< its index
  std::int32_t copy;    ///< the number of the copy, counted record by record
};
/// Lists the copies of all tiles, in each tile in the order of the records. @param out [copies] tile by tile
void list_copies(std::span<const kernels::SplatRecord> records, const TileGrid& grid, const std::int32_t* offsets,
                 TileEntry* out);

/// Sorts the copies of a tile by their keys, the smallest first. Equal keys keep their order.
class TileSort {
 public:
  /// @param first the slot of the first copy of this tile in the image
  /// @param order [entries.size()] the records of the tile
  /// @param slots the slot of each copy of the image; written for those of this tile
  void sort(std::span<const TileEntry> entries, std::int32_t first, std::int32_t* order, std::int32_t* slots);

 private:
  void sort_keys(std::span<const TileEntry> entries);
  std::vector<std::uint64_t> items_, other_;  ///< key and number
};

}  // namespace doppel::splats
