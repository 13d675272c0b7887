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

void count_copies(const std::vector<SplatRecord>& records, const TileGrid& grid, std::int32_t* first,
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

void fill_tiles(const std::vector<SplatRecord>& records, const TileGrid& grid, const std::int32_t* offsets,
                SplatRecord* out, std::int32_t* copies) {
  std::vector<std::int32_t> next(offsets, offsets + grid.tiles());
  std::int32_t copy = 0;
  for (const SplatRecord& record : records) {
    for_each_tile(record, grid.columns(), [&](std::int64_t tile) {
      const std::int32_t slot = next[tile]++;
      out[slot] = record;
      copies[slot] = copy++;
    });
  }
}

void TileSort::sort_keys(const SplatRecord* records, std::int64_t count) {
  std::array<std::array<std::int32_t, as_size(kDigitMask) + 1>, kDigits> starts{};
  items_.resize(as_size(count));
  other_.resize(as_size(count));
  for (std::int64_t i = 0; i < count; ++i) {
    const std::uint64_t key = records[i].key;
    items_[i] = key << 32 | static_cast<std::uint64_t>(i);
    for (int d = 0; d < kDigits; ++d) ++starts[d][key >> (d * kDigitBits) & kDigitMask];
  }
  for (int d = 0; d < kDigits; ++d) {
    const int shift = 32 + d * kDigitBits;
    if (count > 0 && starts[d][items_[0] >> shift & kDigitMask] == count) continue;  // all have this digit
    std::int32_t sum = 0;
    for (std::int32_t& start : starts[d]) sum += std::exchange(start, sum);
    for (const std::uint64_t item : items_) other_[starts[d][item >> shift & kDigitMask]++] = item;
    items_.swap(other_);
  }
}

void TileSort::sort(SplatRecord* records, std::int64_t count, const std::int32_t* copies, std::int32_t first,
                    std::int32_t* slots) {
  sort_keys(records, count);
  before_.assign(records, records + count);
  for (std::int64_t i = 0; i < count; ++i) {
    const auto number = static_cast<std::size_t>(items_[i] & 0xffffffffu);
    records[i] = before_[number];
    slots[copies[number]] = first + static_cast<std::int32_t>(i);
  }
}

}  // namespace doppel::splats
