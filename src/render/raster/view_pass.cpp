#include "doppel/render/raster/view_pass.h"

#include <algorithm>
#include <cstring>

#include "doppel/core/as_size.h"
#include "doppel/render/raster/clip.h"

namespace doppel::render {

using kernels::CutTriangle;
using kernels::FaceTiles;
using kernels::kTile;

void ViewPass::begin(const FaceTable& faces, const float* vertices, std::int64_t num_vertices, const float* matrix,
                     int width, int height, float z_near, bool cull, int num_chunks) {
  begin(faces.corners.data(), faces.num_faces, vertices, num_vertices, matrix, width, height, z_near, cull, num_chunks);
}

void ViewPass::begin(const std::int32_t* faces, std::int64_t num_faces, const float* vertices,
                     std::int64_t num_vertices, const float* matrix, int width, int height, float z_near, bool cull,
                     int num_chunks) {
  num_vertices_ = num_vertices;
  num_faces_ = num_faces;
  screen_.resize(4 * std::max<std::int64_t>(num_vertices, 1));
  view_.vertices = vertices;
  std::memcpy(view_.matrix, matrix, sizeof view_.matrix);
  view_.faces = faces;
  view_.screen = screen_.data();
  view_.width = width;
  view_.height = height;
  view_.z_near = z_near;
  view_.cull = cull ? 1 : 0;
  tiles_x_ = (width + kTile - 1) / kTile;
  tiles_y_ = (height + kTile - 1) / kTile;
  num_chunks_ = num_chunks;
  if (chunks_.size() < as_size(num_chunks)) chunks_.resize(num_chunks);
  for (int i = 0; i < num_chunks; ++i) {
    chunks_[i].begin = num_faces_ * i / num_chunks;
    chunks_[i].end = num_faces_ * (i + 1) / num_chunks;
  }
}

void ViewPass::prepare() {
  project(0, num_vertices_);
  for (int i = 0; i < num_chunks_; ++i) bin(i);
}

void ViewPass::bin(int chunk) {
  bound(chunks_[chunk]);
  sort(chunks_[chunk]);
}

bool ViewPass::tiles_of(const CutTriangle& t, FaceTiles& tiles) const {
  const auto [low_x, high_x] = std::minmax({t.x[0], t.x[1], t.x[2]});
  const auto [low_y, high_y] = std::minmax({t.y[0], t.y[1], t.y[2]});
  constexpr int half = kernels::kSubpixels / 2;
  const int x0 = std::max((low_x + half - 1) >> kernels::kSubpixelBits, 0);
  const int y0 = std::max((low_y + half - 1) >> kernels::kSubpixelBits, 0);
  const int x1 = std::min((high_x - half) >> kernels::kSubpixelBits, view_.width - 1);
  const int y1 = std::min((high_y - half) >> kernels::kSubpixelBits, view_.height - 1);
  if (x0 > x1 || y0 > y1) return false;
  tiles = {t.face, static_cast<std::int16_t>(x0 / kTile), static_cast<std::int16_t>(y0 / kTile),
           static_cast<std::int16_t>(x1 / kTile), static_cast<std::int16_t>(y1 / kTile)};
  return true;
}

/// Finds the tiles of each face. A face that must be cut is replaced by the remaining triangles at the same position in
/// the order.
void ViewPass::bound(Chunk& chunk) {
  chunk.bounds.resize(chunk.end - chunk.begin);
  chunk.bounds.resize(kernels::bound_faces(view_, chunk.begin, chunk.end, chunk.bounds.data()));
  chunk.cut.clear();
  chunk.codes.clear();
  const bool any_cut =
      std::any_of(chunk.bounds.begin(), chunk.bounds.end(), [](const FaceTiles& f) { return f.x0 < 0; });
  if (!any_cut) return;
  std::vector<FaceTiles> bounds;
  for (const FaceTiles& f : chunk.bounds) {
    if (f.x0 >= 0) {
      bounds.push_back(f);
      chunk.codes.push_back(f.face);
      continue;
    }
    std::size_t i = chunk.cut.size();
    cut_face(view_, f.face, chunk.cut);
    for (FaceTiles tiles; i < chunk.cut.size(); ++i) {
      if (!tiles_of(chunk.cut[i], tiles)) continue;
      bounds.push_back(tiles);
      chunk.codes.push_back(~static_cast<std::int32_t>(i));
    }
  }
  chunk.bounds = std::move(bounds);
}

namespace {

/// Calls `visit` with the index of each tile that a face touches. Most faces touch one tile.
template <typename Visit>
void visit_tiles(const FaceTiles& f, int tiles_x, const Visit& visit) {
  if (f.x0 == f.x1 && f.y0 == f.y1) {
    visit(f.y0 * tiles_x + f.x0);
    return;
  }
  for (int y = f.y0; y <= f.y1; ++y)
    for (int x = f.x0; x <= f.x1; ++x) visit(y * tiles_x + x);
}

}  // namespace

/// Counting sort by tile; it is stable, so each bin lists its faces in ascending order.
void ViewPass::sort(Chunk& chunk) {
  std::vector<std::int32_t>& offsets = chunk.offsets;
  offsets.assign(num_tiles() + 2, 0);
  std::int32_t* counts = offsets.data() + 2;
  for (const FaceTiles& f : chunk.bounds) visit_tiles(f, tiles_x_, [counts](int tile) { ++counts[tile]; });
  for (std::size_t i = 2; i < offsets.size(); ++i) offsets[i] += offsets[i - 1];
  chunk.entries.resize(offsets.back());
  const bool coded = !chunk.codes.empty();
  std::int32_t* next = offsets.data() + 1;
  std::int32_t* entries = chunk.entries.data();
  for (std::size_t i = 0; i < chunk.bounds.size(); ++i) {
    const FaceTiles& f = chunk.bounds[i];
    const std::int32_t code = coded ? chunk.codes[i] : f.face;
    visit_tiles(f, tiles_x_, [=](int tile) { entries[next[tile]++] = code; });
  }
}

bool ViewPass::tile_empty(int tile) const {
  const auto t = as_size(tile);
  return std::all_of(chunks_.begin(), chunks_.begin() + num_chunks_,
                     [t](const Chunk& chunk) { return chunk.offsets[t] == chunk.offsets[t + 1]; });
}

template <typename Draw>
void ViewPass::for_each_bin(int tile, const Draw& draw) const {
  const auto t = as_size(tile);
  for (int i = 0; i < num_chunks_; ++i) {
    const Chunk& chunk = chunks_[i];
    const std::int32_t first = chunk.offsets[t], count = chunk.offsets[t + 1] - first;
    if (count == 0) continue;
    draw(kernels::TileWork{chunk.entries.data() + first, count, chunk.cut.data(), tile % tiles_x_ * kTile,
                           tile / tiles_x_ * kTile});
  }
}

void ViewPass::draw_tile(int tile, kernels::TileBuffer& buffer, kernels::TileRect& dirty,
                         const kernels::RasterOutput& out) const {
  const kernels::TileRect drawn = draw_tile(tile, buffer);
  const kernels::TileRect both{std::min(drawn.x0, dirty.x0), std::min(drawn.y0, dirty.y0), std::max(drawn.x1, dirty.x1),
                               std::max(drawn.y1, dirty.y1)};
  dirty = drawn;
  if (both.x1 <= both.x0) return;
  kernels::resolve_tile(view_, tile % tiles_x_ * kTile, tile / tiles_x_ * kTile, both, buffer, out);
}

kernels::TileRect ViewPass::draw_tile(int tile, kernels::TileBuffer& buffer) const {
  kernels::TileRect drawn;
  for_each_bin(tile, [&](const kernels::TileWork& work) { kernels::draw_tile(view_, work, buffer, drawn); });
  return drawn;
}

void ViewPass::cover_tile(int tile, std::uint64_t* rows) const {
  for_each_bin(tile, [&](const kernels::TileWork& work) { kernels::cover_tile(view_, work, rows); });
}

void reset(kernels::TileBuffer& buffer) {
  std::fill(std::begin(buffer.inverse_depth), std::end(buffer.inverse_depth), 0.0f);
  std::fill(std::begin(buffer.face), std::end(buffer.face), -1);
}

}  // namespace doppel::render
