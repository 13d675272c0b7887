#include "doppel/render/outline.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/render/face_table.h"

namespace doppel {
namespace {

using render::ViewPass;
using torch::Tensor;

constexpr const char* kCaller = "outline_points";
constexpr float kNear = 0.01f;  // metres
constexpr int kBorder = 2;      // pixels

struct SurfacePoint {
  std::int32_t face;
  std::array<float, 3> barycentrics;
};

/// The images of one view, reused for the next view.
struct OutlineCanvas {
  OutlineCanvas(int w, int h)
      : width(w), height(h), face_id(as_size(w) * as_size(h), -1), barycentrics(3 * face_id.size(), 0.0f) {}

  void draw(const render::FaceTable& faces, const float* vertices, std::int64_t num_vertices, const float* matrix) {
    pass.begin(faces, vertices, num_vertices, matrix, width, height, kNear, false);
    pass.prepare();
    if (dirty.empty()) {
      dirty.assign(as_size(pass.num_tiles()), {});
      render::reset(buffer);
    }
    for (int tile = 0; tile < pass.num_tiles(); ++tile)
      pass.draw_tile(tile, buffer, dirty[as_size(tile)], {face_id.data(), nullptr, barycentrics.data()});
  }

  std::vector<SurfacePoint> points() const {
    std::vector<SurfacePoint> found;
    for (int y = kBorder; y < height - kBorder; ++y)
      for (int x = kBorder; x < width - kBorder; ++x) {
        const std::size_t i = as_size(y) * as_size(width) + as_size(x);
        const auto row = as_size(width);
        if (face_id[i] < 0) continue;
        if (face_id[i - 1] >= 0 && face_id[i + 1] >= 0 && face_id[i - row] >= 0 && face_id[i + row] >= 0) continue;
        found.push_back({face_id[i], {barycentrics[3 * i], barycentrics[3 * i + 1], barycentrics[3 * i + 2]}});
      }
    return found;
  }

  int width, height;
  ViewPass pass;
  std::vector<std::int32_t> face_id;  ///< [H,W]
  std::vector<float> barycentrics;    ///< [H,W,3]
  std::vector<kernels::TileRect> dirty;
  kernels::TileBuffer buffer;
};

OutlinePoints pack(const std::vector<std::vector<SurfacePoint>>& views, const render::FaceTable& faces) {
  std::size_t longest = 0;
  for (const auto& view : views) longest = std::max(longest, view.size());
  const auto count = static_cast<std::int64_t>(views.size()), length = static_cast<std::int64_t>(longest);
  OutlinePoints out{torch::zeros({count, length, 3}, torch::kInt64), torch::zeros({count, length, 3}),
                    torch::zeros({count, length}, torch::kBool)};
  for (std::size_t v = 0; v < views.size(); ++v) {
    auto* corners = out.corners.data_ptr<std::int64_t>() + 3 * longest * v;
    auto* barycentrics = out.barycentrics.data_ptr<float>() + 3 * longest * v;
    std::fill_n(out.used.data_ptr<bool>() + longest * v, views[v].size(), true);
    for (const SurfacePoint& point : views[v]) {
      corners = std::copy_n(faces.corners.data() + 4 * as_size(point.face), 3, corners);
      barycentrics = std::copy_n(point.barycentrics.data(), 3, barycentrics);
    }
  }
  return out;
}

}  // namespace

OutlinePoints outline_points(const Tensor& vertices, const Tensor& projection, const Tensor& faces, std::int64_t height,
                             std::int64_t width, const Tensor& valid) {
  const render::FaceTable table = render::make_face_table(faces, kCaller);
  render::check_floats(vertices, kCaller, "vertices", {-1, -1, 3});
  render::check_floats(projection, kCaller, "projection", {vertices.size(0), -1, 3, 4});
  render::check_image_size(height, width, kCaller);
  const std::int64_t cameras = projection.size(1), num_vertices = vertices.size(1), views = vertices.size(0) * cameras;
  if (table.num_vertices > num_vertices)
    fail<UsageError>("{}: a face names vertex {}, and there are only {}", kCaller, table.num_vertices - 1,
                     num_vertices);
  if (valid.defined() && (valid.scalar_type() != torch::kBool || valid.numel() != views))
    fail<UsageError>("{}: valid must be bool [{},{}], found {}", kCaller, vertices.size(0), cameras,
                     render::describe(valid));
  const Tensor points = vertices.detach().contiguous(), matrices = projection.detach().contiguous();
  const Tensor use = valid.defined() ? valid.contiguous() : torch::ones({views}, torch::kBool);

  std::vector<std::vector<SurfacePoint>> found(as_size(views));
  std::atomic<std::int64_t> next{0};
  const std::int64_t workers = std::min<std::int64_t>(views, at::get_num_threads());
  at::parallel_for(0, workers, 1, [&](std::int64_t first, std::int64_t last) {
    for (std::int64_t worker = first; worker < last; ++worker) {
      OutlineCanvas canvas(static_cast<int>(width), static_cast<int>(height));
      for (std::int64_t v = next++; v < views; v = next++) {
        if (!use.data_ptr<bool>()[v]) continue;
        canvas.draw(table, points.data_ptr<float>() + 3 * num_vertices * (v / cameras), num_vertices,
                    matrices.data_ptr<float>() + 12 * v);
        found[as_size(v)] = canvas.points();
      }
    }
  });
  return pack(found, table);
}

}  // namespace doppel
