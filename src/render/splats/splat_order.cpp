#include "doppel/render/splats/splat_order.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel::splats {
namespace {

using kernels::kSplatTileHeight;
using kernels::kSplatTileWidth;
using kernels::SplatRecord;

constexpr int kDigitBits = 8, kDigits = 4;
constexpr std::uint64_t kDigitMask = (1u << kDigitBits) - 1;

/// Calls visit(tile) for each tile that a record touches, row by row.
template <typename Visit>
void for_each_tile(const SplatRecord& r, std::int64_t columns, const Visit& visit) {
  if (r.key == kernels::kHiddenSplat) return;
  const unsigned x0 = r.x0, x1 = r.x1, y0 = r.y0, y1 = r.y1;
  for (unsigned y = y0 / kSplatTileHeight; y <= y1 / kSplatTileHeight; ++y)
    for (unsigned x = x0 / kSplatTileWidth; x <= x1 / kSplatTileWidth; ++x) visit(y * columns + x);
}

}  // namespace

void count_copies(std::span<const SplatRecord> records, const TileGrid& grid, std::int32_t* first,
                  std::int32_t* offsets) {
  std::fill_n(offsets, grid.tiles() + 1, 0);
  std::int64_t copies = 0;
  for (const SplatRecord& record : records) {
    *first++ = static_cast<std::int32_t>(copies);
    for_each_tile(record, grid.columns(), [&](std::int64_t tile) {
      ++offsets[tile + 1];
      ++copies;
    });
  }
  if (copies > std::numeric_limits<std::int32_t>::max())
    fail<UsageError>(
        "draw_splats: {} Gaussians touch {} tiles in one image; at most 2^31 - 1 are allowed. Draw fewer or smaller "
        "ones",
        records.size(), copies);
  *first = static_cast<std::int32_t>(copies);
  for (std::int64_t tile = 0; tile < grid.tiles(); ++tile) offsets[tile + 1] += offsets[tile];
}

void list_copies(std::span<const SplatRecord> records, const TileGrid& grid, const std::int32_t* offsets,
                 TileEntry* out) {
  std::vector<std::int32_t> next(offsets, offsets + grid.tiles());
  std::int32_t number = 0, copy = 0;
  for (const SplatRecord& record : records) {
    for_each_tile(record, grid.columns(), [&](std::int64_t tile) { out[next[tile]++] = {record.key, number, copy++}; });
    ++number;
  }
}

void TileSort::sort_keys(std::span<const TileEntry> entries) {
  std::array<std::array<std::int32_t, as_size(kDigitMask) + 1>, kDigits> starts{};
  items_.resize(entries.size());
  other_.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::uint64_t key = entries[i].key;
    items_[i] = key << 32 | i;
    for (int d = 0; d < kDigits; ++d) ++starts[d][key >> (d * kDigitBits) & kDigitMask];
  }
  for (int d = 0; d < kDigits; ++d) {
    const int shift = 32 + d * kDigitBits;
    if (!items_.empty() && as_size(starts[d][items_[0] >> shift & kDigitMask]) == items_.size())
      continue;  // all have this digit
    std::int32_t sum = 0;
    for (std::int32_t& start : starts[d]) sum += std::exchange(start, sum);
    for (const std::uint64_t item : items_) other_[starts[d][item >> shift & kDigitMask]++] = item;
    items_.swap(other_);
  }
}

void TileSort::sort(std::span<const TileEntry> entries, std::int32_t first, std::int32_t* order, std::int32_t* slots) {
  sort_keys(entries);
  for (const std::uint64_t item : items_) {
    const TileEntry& e = entries[item & 0xffffffffu];
    *order++ = e.record;
    slots[e.copy] = first++;
  }
}

}  // namespace doppel::splats
