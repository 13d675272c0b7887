#include "doppel/render/raster/rasterizer.h"

#include <torch/library.h>

#include <algorithm>
#include <array>
#include <limits>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/render/raster/face_table.h"
#include "doppel/render/raster/view_workers.h"

namespace doppel {

using render::ViewPass;
using torch::Tensor;

namespace {

using Matrix = std::array<float, 12>;

Matrix matrix_of_intrinsics(const float* k) { return {k[0], 0, k[2], 0, 0, k[1], k[3], 0, 0, 0, 1, 0}; }

std::vector<Matrix> matrices_of_intrinsics(const Tensor& intrinsics, std::int64_t num_views) {
  const Tensor rows = intrinsics.contiguous();
  const float* data = rows.data_ptr<float>();
  std::vector<Matrix> matrices;
  for (std::int64_t v = 0; v < num_views; ++v) {
    matrices.push_back(matrix_of_intrinsics(data + 4 * (rows.size(0) == 1 ? 0 : v)));
  }
  return matrices;
}

void check_views(const Tensor& vertices, const Tensor& intrinsics, const render::FaceTable& faces, std::int64_t height,
                 std::int64_t width) {
  check_floats("rasterize", "vertices", vertices, {-1, -1, 3});
  check_floats("rasterize", "intrinsics", intrinsics, {-1, 4});
  if (intrinsics.size(0) != vertices.size(0) && intrinsics.size(0) != 1) {
    fail<UsageError>(
        "rasterize: {} views of vertices and {} of intrinsics; the numbers must be equal, or intrinsics must be one",
        vertices.size(0), intrinsics.size(0));
  }
  render::check_corners("rasterize", faces, vertices.size(1));
  render::check_image_size(height, width, "rasterize");
}

/// Expands the first `count` of 64 bits to bytes of 0 or 1.
void expand_bits(std::uint64_t bits, int count, std::uint8_t* out) {
  for (int i = 0; i < count; ++i) out[i] = static_cast<std::uint8_t>((bits >> i) & 1);
}

void write_cover(const ViewPass& pass, int tile, std::int64_t height, std::int64_t width, std::uint8_t* image) {
  std::array<std::uint64_t, kernels::kTile> rows{};
  pass.cover_tile(tile, rows.data());
  const std::int64_t x = tile % pass.tiles_x() * kernels::kTile, y = tile / pass.tiles_x() * kernels::kTile;
  const int columns = static_cast<int>(std::min<std::int64_t>(kernels::kTile, width - x));
  for (std::int64_t r = 0; r < std::min<std::int64_t>(kernels::kTile, height - y); ++r) {
    expand_bits(rows[r], columns, image + (y + r) * width + x);
  }
}

}  // namespace

struct Rasterizer::State {
  render::FaceTable faces;
  RasterizerOptions options;
  RasterImage image;
  std::vector<std::vector<kernels::TileRect>> dirty;  ///< [V][tiles] part of the images that is not background
  render::ViewWorkers workers;

  void shape_outputs(std::int64_t views, std::int64_t height, std::int64_t width);
  /// Draws all views into `image`; begin(pass, view, chunks) starts one.
  template <typename Begin>
  void draw(std::int64_t height, std::int64_t width, const Begin& begin);
};

void Rasterizer::State::shape_outputs(std::int64_t views, std::int64_t height, std::int64_t width) {
  const std::array<std::int64_t, 3> shape{views, height, width};
  if (image.depth.defined() && image.depth.sizes() == torch::IntArrayRef(shape)) return;
  image.face_id = torch::full({views, height, width}, -1, torch::kInt32);
  image.depth = torch::full({views, height, width}, std::numeric_limits<float>::infinity(), torch::kFloat32);
  image.barycentrics = torch::zeros({views, height, width, 3}, torch::kFloat32);
  const std::int64_t tiles =
      (height + kernels::kTile - 1) / kernels::kTile * ((width + kernels::kTile - 1) / kernels::kTile);
  dirty.assign(views, std::vector<kernels::TileRect>(tiles));
}

template <typename Begin>
void Rasterizer::State::draw(std::int64_t height, std::int64_t width, const Begin& begin) {
  const std::int64_t pixels = height * width;
  std::int32_t* face_id = image.face_id.data_ptr<std::int32_t>();
  float* depth = image.depth.data_ptr<float>();
  float* barycentrics = image.barycentrics.data_ptr<float>();
  workers.run(image.depth.size(0), begin, [&](const ViewPass& pass, std::int64_t v, int tile, std::int64_t thread) {
    const kernels::RasterOutput out{face_id + pixels * v, depth + pixels * v, barycentrics + 3 * pixels * v};
    pass.draw_tile(tile, workers.buffer(thread), dirty[v][tile], out);
  });
}

Rasterizer::Rasterizer(const Tensor& faces, const RasterizerOptions& options) : state_(std::make_unique<State>()) {
  if (!(options.z_near > 0)) fail<UsageError>("Rasterizer: z_near is {} m; it must be greater than 0", options.z_near);
  state_->faces = render::make_face_table(faces, "Rasterizer");
  state_->options = options;
}

Rasterizer::~Rasterizer() = default;
Rasterizer::Rasterizer(Rasterizer&&) noexcept = default;
Rasterizer& Rasterizer::operator=(Rasterizer&&) noexcept = default;

const RasterImage& Rasterizer::rasterize(const Tensor& vertices_in_camera, const Tensor& intrinsics,
                                         std::int64_t height, std::int64_t width) {
  State& s = *state_;
  check_views(vertices_in_camera, intrinsics, s.faces, height, width);
  const Tensor vertices = vertices_in_camera.contiguous();
  const std::int64_t views = vertices.size(0), num_vertices = vertices.size(1);
  const std::vector<Matrix> matrices = matrices_of_intrinsics(intrinsics, views);
  s.shape_outputs(views, height, width);
  const float* points = vertices.data_ptr<float>();
  s.draw(height, width, [&](ViewPass& pass, std::int64_t v, int chunks) {
    pass.begin(s.faces, points + 3 * num_vertices * v, num_vertices, matrices[v].data(), static_cast<int>(width),
               static_cast<int>(height), s.options.z_near, s.options.cull, chunks);
  });
  return s.image;
}

const RasterImage& Rasterizer::rasterize_projected(const Tensor& vertices, const Tensor& projection,
                                                   std::int64_t height, std::int64_t width) {
  State& s = *state_;
  render::check_drawing("rasterize", vertices, projection, s.faces, height, width);
  const Tensor points = vertices.contiguous(), matrices = projection.contiguous();
  const std::int64_t cameras = projection.size(1), num_vertices = vertices.size(1);
  s.shape_outputs(vertices.size(0) * cameras, height, width);
  s.draw(height, width, [&](ViewPass& pass, std::int64_t v, int chunks) {
    pass.begin(s.faces, points.data_ptr<float>() + 3 * num_vertices * (v / cameras), num_vertices,
               matrices.data_ptr<float>() + 12 * v, static_cast<int>(width), static_cast<int>(height), s.options.z_near,
               s.options.cull, chunks);
  });
  return s.image;
}

Tensor Rasterizer::coverage(const Tensor& vertices_in_camera, const Tensor& intrinsics, std::int64_t height,
                            std::int64_t width) {
  State& s = *state_;
  check_views(vertices_in_camera, intrinsics, s.faces, height, width);
  const std::int64_t views = vertices_in_camera.size(0);
  Tensor projection = torch::zeros({views, 1, 3, 4});
  const std::vector<Matrix> matrices = matrices_of_intrinsics(intrinsics, views);
  if (views > 0) std::copy_n(matrices[0].data(), 12 * views, projection.data_ptr<float>());
  return coverage_projected(vertices_in_camera, projection, height, width).squeeze(1);
}

Tensor Rasterizer::coverage_projected(const Tensor& vertices, const Tensor& projection, std::int64_t height,
                                      std::int64_t width) {
  State& s = *state_;
  render::check_drawing("coverage", vertices, projection, s.faces, height, width);
  const Tensor points = vertices.contiguous(), matrices = projection.contiguous();
  const std::int64_t cameras = projection.size(1), num_vertices = vertices.size(1), pixels = height * width;
  Tensor mask = torch::zeros({vertices.size(0), cameras, height, width}, torch::kUInt8);
  std::uint8_t* out = mask.data_ptr<std::uint8_t>();
  const float* x = points.data_ptr<float>();
  const float* p = matrices.data_ptr<float>();
  s.workers.run(
      vertices.size(0) * cameras,
      [&](ViewPass& pass, std::int64_t v, int chunks) {
        pass.begin(s.faces, x + 3 * num_vertices * (v / cameras), num_vertices, p + 12 * v, static_cast<int>(width),
                   static_cast<int>(height), s.options.z_near, s.options.cull, chunks);
      },
      [&](const ViewPass& pass, std::int64_t v, int tile, std::int64_t) {
        if (!pass.tile_empty(tile)) write_cover(pass, tile, height, width, out + pixels * v);
      });
  return mask;
}

RasterImage rasterize(const Tensor& vertices_in_camera, const Tensor& intrinsics, const Tensor& faces,
                      std::int64_t height, std::int64_t width, const RasterizerOptions& options) {
  Rasterizer rasterizer(faces, options);
  return rasterizer.rasterize(vertices_in_camera, intrinsics, height, width);
}

namespace {

std::tuple<Tensor, Tensor, Tensor> rasterize_cpu(const Tensor& vertices_in_camera, const Tensor& intrinsics,
                                                 const Tensor& faces, std::int64_t height, std::int64_t width,
                                                 double z_near, bool cull) {
  const RasterImage image =
      rasterize(vertices_in_camera, intrinsics, faces, height, width, {static_cast<float>(z_near), cull});
  return {image.face_id, image.depth, image.barycentrics};
}

}  // namespace

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def(
      "rasterize(Tensor vertices_in_camera, Tensor intrinsics, Tensor faces, int height, int width, float z_near=0.01, "
      "bool cull=False) -> (Tensor face_id, Tensor depth, Tensor barycentrics)");
}

TORCH_LIBRARY_IMPL(doppel, CPU, m) { m.impl("rasterize", &rasterize_cpu); }

}  // namespace doppel
