#pragma once

#include <cstdint>
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
void count_copies(const std::vector<kernels::SplatRecord>& records, const TileGrid& grid, std::int32_t* first,
                  std::int32_t* offsets);
/// Copies the records to their tiles, in each tile in the order of their indices.
/// @param out [copies] tile by tile @param copies [copies] the number of the copy at each slot of `out`, counted
/// record by record
void fill_tiles(const std::vector<kernels::SplatRecord>& records, const TileGrid& grid, const std::int32_t* offsets,
                kernels::SplatRecord* out, std::int32_t* copies);

/// Sorts the records of a tile by their keys, the smallest first. Equal keys keep their order.
class TileSort {
 public:
  /// @param copies [count] of the records before @param first the slot of the first record in the image
  /// @param slots where each copy of the image lies now; written for those of this tile
  void sort(kernels::SplatRecord* records, std::int64_t count, const std::int32_t* copies, std::int32_t first,
            std::int32_t* slots);

 private:
  void sort_keys(const kernels::SplatRecord* records, std::int64_t count);
  std::vector<std::uint64_t> items_, other_;  ///< key and number
  std::vector<kernels::SplatRecord> before_;
};

}  // namespace doppel::splats
