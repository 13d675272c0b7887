#include "doppel/render/outline/boundary.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/render/raster/face_table.h"

namespace doppel {
namespace {

using render::ViewPass;
using torch::Tensor;

/// The images of one view, reused for the next view.
struct CoverageCanvas {
  ViewPass pass;
  std::vector<std::uint64_t> covered;  ///< [H, tiles_x] bit per pixel
  std::vector<std::uint64_t> rows;     ///< covered with both neighbours in the row
  std::vector<std::uint64_t> inner;    ///< covered with all eight neighbours
  std::vector<float> depth;            ///< [H,W], visible_only
  std::vector<kernels::TileRect> dirty;
  kernels::TileBuffer buffer;
  int width = 0, height = 0;

  bool bit(const std::vector<std::uint64_t>& image, int x, int y) const {
    return (image[y * pass.tiles_x() + x / kernels::kTile] >> (x % kernels::kTile)) & 1;
  }
};

void cover(CoverageCanvas& canvas) {
  const ViewPass& pass = canvas.pass;
  canvas.covered.assign(canvas.height * pass.tiles_x(), 0);
  for (int tile = 0; tile < pass.num_tiles(); ++tile) {
    if (pass.tile_empty(tile)) continue;
    std::array<std::uint64_t, kernels::kTile> rows{};
    pass.cover_tile(tile, rows.data());
    const int column = tile % pass.tiles_x(), y = tile / pass.tiles_x() * kernels::kTile;
    for (int r = 0; r < std::min(kernels::kTile, canvas.height - y); ++r) {
      canvas.covered[(y + r) * pass.tiles_x() + column] = rows[r];
    }
  }
}

void draw_depth(CoverageCanvas& canvas) {
  const ViewPass& pass = canvas.pass;
  if (canvas.depth.empty()) {
    canvas.depth.assign(as_size(canvas.width) * as_size(canvas.height), std::numeric_limits<float>::infinity());
    canvas.dirty.assign(pass.num_tiles(), {});
    render::reset(canvas.buffer);
  }
  for (int tile = 0; tile < pass.num_tiles(); ++tile) {
    pass.draw_tile(tile, canvas.buffer, canvas.dirty[tile], {nullptr, canvas.depth.data(), nullptr});
  }
}

/// Marks the pixels whose whole 3x3 neighbourhood is covered, 64 at a time. Border pixels are never marked.
void erode(CoverageCanvas& canvas) {
  const int words = canvas.pass.tiles_x();
  const std::vector<std::uint64_t>& in = canvas.covered;
  std::vector<std::uint64_t>& rows = canvas.rows;
  rows.resize(in.size());
  for (std::size_t i = 0; i < in.size(); ++i) {
    const bool first = i % as_size(words) == 0, last = (i + 1) % as_size(words) == 0;
    const std::uint64_t before = first ? 0 : in[i - 1] >> 63, after = last ? 0 : in[i + 1] << 63;
    rows[i] = in[i] & (in[i] << 1 | before) & (in[i] >> 1 | after);
  }
  canvas.inner.assign(in.size(), 0);
  const auto row = as_size(words);
  for (std::size_t i = row; i + row < in.size(); ++i) canvas.inner[i] = rows[i - row] & rows[i] & rows[i + row];
}

/// Whether the surface in at least one of the 3x3 pixels is not nearer than the vertex. The vertex's own pixel alone
/// would be too strict, because surfaces turn away from the camera at the outline.
bool is_seen(const CoverageCanvas& canvas, int x, int y, float depth, float tolerance) {
  bool any = false;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (!canvas.bit(canvas.covered, x + dx, y + dy)) continue;
      any = true;
      if (canvas.depth[as_size(y + dy) * as_size(canvas.width) + as_size(x + dx)] >= depth - tolerance) {
        return true;
      }
    }
  }
  return !any;
}

void mark_vertices(const CoverageCanvas& canvas, const BoundaryOptions& options, bool* out) {
  const float* screen = canvas.pass.screen();
  const auto right = static_cast<float>(canvas.width - 1), bottom = static_cast<float>(canvas.height - 1);
  for (std::int64_t i = 0; i < canvas.pass.num_vertices(); ++i) {
    const float u = screen[4 * i], v = screen[4 * i + 1];
    out[i] = false;
    if (!(screen[4 * i + 2] > 0) || !(u >= 1 && v >= 1 && u < right && v < bottom)) continue;
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    out[i] = !canvas.bit(canvas.inner, x, y) &&
             (!options.visible_only || is_seen(canvas, x, y, screen[4 * i + 3], options.depth_tolerance));
  }
}

}  // namespace

Tensor boundary_vertices(const Tensor& vertices, const Tensor& projection, const Tensor& faces, std::int64_t height,
                         std::int64_t width, const Tensor& valid, const BoundaryOptions& options) {
  const render::FaceTable table = render::make_face_table(faces, "boundary_vertices");
  const Tensor points = vertices.defined() ? vertices.detach().contiguous() : vertices;
  const Tensor matrices = projection.defined() ? projection.detach().contiguous() : projection;
  render::check_drawing("boundary_vertices", points, matrices, table, height, width);
  if (valid.defined())
    check_tensor("boundary_vertices", "valid", valid, {torch::kBool}, {points.size(0), matrices.size(1)}, "[B,C]");
  const std::int64_t cameras = matrices.size(1), num_vertices = points.size(1), views = points.size(0) * cameras;
  Tensor boundary = torch::zeros({points.size(0), cameras, num_vertices}, torch::kBool);
  const Tensor use = valid.defined() ? valid.contiguous() : Tensor();
  const bool* used = use.defined() ? use.data_ptr<bool>() : nullptr;
  const float* x = points.data_ptr<float>();
  const float* p = matrices.data_ptr<float>();
  bool* out = boundary.data_ptr<bool>();

  std::atomic<std::int64_t> next{0};
  const std::int64_t workers = std::min<std::int64_t>(views, at::get_num_threads());
  at::parallel_for(0, workers, 1, [&](std::int64_t first, std::int64_t last) {
    for (std::int64_t worker = first; worker < last; ++worker) {
      CoverageCanvas canvas;
      canvas.width = static_cast<int>(width);
      canvas.height = static_cast<int>(height);
      for (std::int64_t v = next++; v < views; v = next++) {
        if (used && !used[v]) continue;
        canvas.pass.begin(table, x + 3 * num_vertices * (v / cameras), num_vertices, p + 12 * v, canvas.width,
                          canvas.height, options.z_near, false);
        canvas.pass.prepare();
        cover(canvas);
        erode(canvas);
        if (options.visible_only) draw_depth(canvas);
        mark_vertices(canvas, options, out + num_vertices * v);
      }
    }
  });
  return boundary;
}

}  // namespace doppel
