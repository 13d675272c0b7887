#include "doppel/render/outline/outline.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <opencv2/core/types.hpp>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/render/lease.h"
#include "doppel/render/raster/face_table.h"

namespace doppel {
namespace {

using render::ViewPass;
using torch::Tensor;

constexpr const char* kCaller = "outline_points";
constexpr float kNear = 0.01f;  // metres
constexpr int kBorder = 2;      // pixels

/// The outline of one view: P pixels and what they show.
struct Outline {
  std::vector<std::int32_t> face, x, y;  ///< [P]
  std::vector<float> barycentrics;       ///< [P,3]
};

/// The image of one view, reused for the next view.
class OutlineCanvas {
 public:
  OutlineCanvas(int w, int h)
      : width(w), height(h), face_id_(as_size(w) * as_size(h) + kernels::kTileStride - kernels::kTile, -1) {}

  const int width, height;

  Outline draw(const render::FaceTable& faces, const float* vertices, std::int64_t num_vertices, const float* matrix) {
    pass_.begin(faces, vertices, num_vertices, matrix, width, height, kNear, false);
    pass_.prepare();
    if (dirty_.empty()) {
      dirty_.assign(pass_.num_tiles(), {});
      render::reset(buffer_);
    }
    for (int tile = 0; tile < pass_.num_tiles(); ++tile)
      pass_.draw_tile(tile, buffer_, dirty_[tile], {face_id_.data(), nullptr, nullptr});
    return outline();
  }

 private:
  /// The part of the image that was drawn, without the border.
  cv::Rect drawn() const {
    cv::Rect all;
    for (int tile = 0; tile < pass_.num_tiles(); ++tile) {
      const kernels::TileRect& r = dirty_[tile];
      if (r.x1 <= r.x0) continue;
      all |= cv::Rect(tile % pass_.tiles_x() * kernels::kTile + r.x0, tile / pass_.tiles_x() * kernels::kTile + r.y0,
                      r.x1 - r.x0, r.y1 - r.y0);
    }
    return all & cv::Rect(kBorder, kBorder, std::max(width - 2 * kBorder, 0), std::max(height - 2 * kBorder, 0));
  }

  Outline outline() {
    Outline found;
    const cv::Rect part = drawn();
    columns_.resize(part.width);
    for (int y = part.y; y < part.y + part.height; ++y) {
      const std::int32_t* row = face_id_.data() + as_size(y) * as_size(width);
      const std::int64_t count = kernels::outline_columns(row, width, part.x, part.x + part.width, columns_.data());
      for (std::int64_t i = 0; i < count; ++i) {
        const std::int32_t x = columns_[i];
        found.x.push_back(x);
        found.y.push_back(y);
        found.face.push_back(row[x]);
      }
    }
    found.barycentrics.resize(3 * found.x.size());
    kernels::pixel_barycentrics(pass_.view(), found.face.data(), found.x.data(), found.y.data(),
                                static_cast<std::int64_t>(found.x.size()), found.barycentrics.data());
    return found;
  }

  render::ViewPass pass_;
  std::vector<std::int32_t> face_id_;  ///< [H,W], and what outline_columns reads beyond
  std::vector<kernels::TileRect> dirty_;
  kernels::TileBuffer buffer_;
  std::vector<std::int32_t> columns_;
};

OutlinePoints pack(const std::vector<Outline>& views, const render::FaceTable& faces) {
  std::size_t longest = 0;
  for (const Outline& view : views) longest = std::max(longest, view.face.size());
  const auto count = static_cast<std::int64_t>(views.size()), length = static_cast<std::int64_t>(longest);
  OutlinePoints out{torch::zeros({count, length, 3}, torch::kInt64), torch::zeros({count, length, 3}),
                    torch::zeros({count, length}, torch::kBool)};
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Outline& view = views[v];
    auto* corners = out.corners.data_ptr<std::int64_t>() + 3 * longest * v;
    std::copy(view.barycentrics.begin(), view.barycentrics.end(), out.barycentrics.data_ptr<float>() + 3 * longest * v);
    std::fill_n(out.used.data_ptr<bool>() + longest * v, view.face.size(), true);
    for (const std::int32_t face : view.face)
      corners = std::copy_n(faces.corners.data() + 4 * as_size(face), 3, corners);
  }
  return out;
}

}  // namespace

OutlinePoints outline_points(const Tensor& vertices, const Tensor& projection, const Tensor& faces, std::int64_t height,
                             std::int64_t width, const Tensor& valid) {
  const render::FaceTable table = render::make_face_table(faces, kCaller);
  render::check_drawing(kCaller, vertices, projection, table, height, width);
  const std::int64_t cameras = projection.size(1), num_vertices = vertices.size(1), views = vertices.size(0) * cameras;
  if (valid.defined()) check_tensor(kCaller, "valid", valid, {torch::kBool}, {vertices.size(0), cameras}, "[B,C]");
  const Tensor points = vertices.detach().contiguous(), matrices = projection.detach().contiguous();
  const Tensor use = valid.defined() ? valid.contiguous() : torch::ones({views}, torch::kBool);

  std::vector<Outline> found(views);
  std::atomic<std::int64_t> next{0};
  const std::int64_t workers = std::min<std::int64_t>(views, at::get_num_threads());
  at::parallel_for(0, workers, 1, [&](std::int64_t first, std::int64_t last) {
    for (std::int64_t worker = first; worker < last; ++worker) {
      const int w = static_cast<int>(width), h = static_cast<int>(height);
      // Making a canvas costs as much as drawing a view.
      const render::Lease<OutlineCanvas> canvas([&](const auto& kept) { return kept.width == w && kept.height == h; },
                                                [&] { return std::make_unique<OutlineCanvas>(w, h); });
      for (std::int64_t v = next++; v < views; v = next++) {
        if (!use.data_ptr<bool>()[v]) continue;
        found[v] = canvas->draw(table, points.data_ptr<float>() + 3 * num_vertices * (v / cameras), num_vertices,
                                matrices.data_ptr<float>() + 12 * v);
      }
    }
  });
  return pack(found, table);
}

}  // namespace doppel
