#include "doppel/render/splats/splat_order.h"

#include <algorithm>
#include <array>

#include "doppel/core/as_size.h"

namespace doppel::splats {
namespace {

using kernels::kSplatTileHeight;
using kernels::kSplatTileWidth;
using kernels::SplatRecord;

constexpr int kDigitBits = 11, kDigits = 3;
constexpr std::uint32_t kDigitMask = (1u << kDigitBits) - 1;

/// Calls visit(tile) for each tile that a record touches, row by row.
template <typename Visit>
void for_each_tile(const SplatRecord& r, std::int64_t columns, const Visit& visit) {
  for (int y = r.y0 / kSplatTileHeight; y <= r.y1 / kSplatTileHeight; ++y)
    for (int x = r.x0 / kSplatTileWidth; x <= r.x1 / kSplatTileWidth; ++x) visit(y * columns + x);
}

}  // namespace

const std::vector<std::int32_t>& KeySort::sort(const std::uint32_t* keys, std::int64_t count) {
  std::array<std::array<std::int32_t, as_size(kDigitMask) + 1>, kDigits> starts{};
  keys_.clear();
  order_.clear();
  for (std::int64_t i = 0; i < count; ++i) {
    if (keys[i] == kernels::kHiddenSplat) continue;
    keys_.push_back(keys[i]);
    order_.push_back(static_cast<std::int32_t>(i));
    for (int d = 0; d < kDigits; ++d) ++starts[d][keys[i] >> (d * kDigitBits) & kDigitMask];
  }
  other_keys_.resize(keys_.size());
  other_order_.resize(order_.size());
  for (int d = 0; d < kDigits; ++d) {
    std::int32_t sum = 0;
    for (std::int32_t& start : starts[d]) sum += std::exchange(start, sum);
    for (std::size_t i = 0; i < keys_.size(); ++i) {
      const std::int32_t at = starts[d][keys_[i] >> (d * kDigitBits) & kDigitMask]++;
      other_keys_[at] = keys_[i];
      other_order_[at] = order_[i];
    }
    keys_.swap(other_keys_);
    order_.swap(other_order_);
  }
  return order_;
}

void count_slots(const SplatRecord* records, std::int64_t count, std::int32_t* first) {
  std::int32_t sum = 0;
  for (std::int64_t k = 0; k < count; ++k) {
    const SplatRecord& r = records[k];
    first[k] = sum;
    sum += (r.x1 / kSplatTileWidth - r.x0 / kSplatTileWidth + 1) *
           (r.y1 / kSplatTileHeight - r.y0 / kSplatTileHeight + 1);
  }
  first[count] = sum;
}

void fill_tiles(const SplatRecord* records, std::int64_t count, const std::int32_t* first, const TileGrid& grid,
                std::int32_t* offsets, kernels::SplatPair* pairs) {
  const std::int64_t columns = grid.columns(), tiles = grid.tiles();
  std::fill_n(offsets, tiles + 1, 0);
  for (std::int64_t k = 0; k < count; ++k)
    for_each_tile(records[k], columns, [&](std::int64_t tile) { ++offsets[tile + 1]; });
  for (std::int64_t tile = 0; tile < tiles; ++tile) offsets[tile + 1] += offsets[tile];
  std::vector<std::int32_t> next(offsets, offsets + tiles);
  for (std::int64_t k = 0; k < count; ++k) {
    std::int32_t slot = first[k];
    for_each_tile(records[k], columns, [&](std::int64_t tile) {
      pairs[next[tile]++] = {static_cast<std::int32_t>(k), slot++};
    });
  }
}

}  // namespace doppel::splats
