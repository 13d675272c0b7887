#include "doppel/render/texture/texture_space.h"

#include <ATen/Parallel.h>
#include <torch/library.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/render/raster/face_table.h"
#include "doppel/render/shading/vertex_normals.h"
#include "doppel/render/texture/texture_space_kernel.h"

namespace doppel {

using torch::Tensor;

namespace {

/// The surface point of each texel: a face (-1: none) and its barycentric coordinates.
struct TexelMap {
  int size;
  std::vector<std::int32_t> face;
  std::vector<std::array<double, 3>> weights;

  explicit TexelMap(int texels) : size(texels), face(as_size(texels) * as_size(texels), -1), weights(face.size()) {}
};

/// Assigns the free texels whose centres lie in the triangle to a face. @param corner [3] texels, y down
void fill_face(TexelMap& map, std::int32_t face, const std::array<std::array<double, 2>, 3>& corner) {
  constexpr double kOnEdge = 1e-12;
  const auto& [a, b, c] = corner;
  const double area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
  if (area == 0 || !std::isfinite(area)) return;
  const auto [low_x, high_x] = std::minmax({a[0], b[0], c[0]});
  const auto [low_y, high_y] = std::minmax({a[1], b[1], c[1]});
  const auto last = static_cast<double>(map.size - 1);
  const int x0 = static_cast<int>(std::clamp(std::ceil(low_x - 0.5), 0.0, last + 1));
  const int y0 = static_cast<int>(std::clamp(std::ceil(low_y - 0.5), 0.0, last + 1));
  const int x1 = static_cast<int>(std::clamp(std::floor(high_x - 0.5), -1.0, last));
  const int y1 = static_cast<int>(std::clamp(std::floor(high_y - 0.5), -1.0, last));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const auto texel = as_size(y) * as_size(map.size) + as_size(x);
      if (map.face[texel] >= 0) continue;
      const double px = x + 0.5 - a[0], py = y + 0.5 - a[1];
      const double w1 = (px * (c[1] - a[1]) - (c[0] - a[0]) * py) / area;
      const double w2 = ((b[0] - a[0]) * py - px * (b[1] - a[1])) / area;
      const double w0 = 1 - w1 - w2;
      if (w0 < -kOnEdge || w1 < -kOnEdge || w2 < -kOnEdge) continue;
      map.face[texel] = face;
      map.weights[texel] = {w0, w1, w2};
    }
  }
}

/// The nearest texel with a face within `padding`, the first among equally near texels; -1 if there is none.
std::int64_t nearest_covered(const TexelMap& map, int x, int y, int padding) {
  std::int64_t best = -1;
  int best_square = padding * padding + 1;
  for (int v = std::max(y - padding, 0); v <= std::min(y + padding, map.size - 1); ++v) {
    for (int u = std::max(x - padding, 0); u <= std::min(x + padding, map.size - 1); ++u) {
      const std::int64_t texel = static_cast<std::int64_t>(v) * map.size + u;
      const int square = (u - x) * (u - x) + (v - y) * (v - y);
      if (square >= best_square || map.face[texel] < 0) continue;
      best = texel;
      best_square = square;
    }
  }
  return best;
}

TexelMap cover(const RenderMesh& mesh, int size) {
  TexelMap map(size);
  const float* uv = mesh.corner_uvs.data_ptr<float>();
  for (std::int64_t f = 0; f < mesh.num_faces(); ++f) {
    std::array<std::array<double, 2>, 3> corner{};
    for (auto& c : corner) {
      c = {static_cast<double>(uv[0]) * size, (1 - static_cast<double>(uv[1])) * size};
      uv += 2;
    }
    fill_face(map, static_cast<std::int32_t>(f), corner);
  }
  return map;
}

/// @param mesh face_records, incident_offsets, incident_faces of RenderMesh @param texels runs, corners, weights of
/// kernels::TexelTable @return [B,3,size,size]
Tensor texture_normals_cpu(const Tensor& vertices_in, at::TensorList mesh, at::TensorList texels, std::int64_t size) {
  const std::int64_t num_vertices = mesh[1].size(0) - 1;
  check_floats("texture_normals", "vertices", vertices_in, {-1, num_vertices, 3});
  const Tensor vertices = vertices_in.contiguous();
  const kernels::TexelTable table{texels[0].data_ptr<std::int32_t>(),
                                  texels[1].data_ptr<std::int32_t>(),
                                  texels[2].data_ptr<float>(),
                                  texels[0].size(0),
                                  texels[1].size(1),
                                  size * size};
  const Tensor maps = at::empty({vertices.size(0), 3, size, size}, vertices.options());
  const Tensor of_faces = at::empty({mesh[0].size(0), 4}, vertices.options()),
               of_vertices = at::empty({num_vertices, 4}, vertices.options());
  for (std::int64_t b = 0; b < vertices.size(0); ++b) {
    const kernels::NormalMesh surface{vertices.data_ptr<float>() + 3 * num_vertices * b,
                                      mesh[0].data_ptr<std::int32_t>(), mesh[1].data_ptr<std::int32_t>(),
                                      mesh[2].data_ptr<std::int32_t>()};
    render::sum_vertex_normals(surface, mesh[0].size(0), num_vertices, of_faces.data_ptr<float>(),
                               of_vertices.data_ptr<float>());
    const float* normals = of_vertices.data_ptr<float>();
    float* map = maps.data_ptr<float>() + 3 * table.map_size * b;
    at::parallel_for(0, table.num_runs, 1, [&](std::int64_t begin, std::int64_t end) {
      kernels::texel_normals(table, normals, begin, end, map);
    });
  }
  return maps;
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def("texture_normals(Tensor vertices, Tensor[] mesh, Tensor[] texels, int size) -> Tensor");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) { m.impl("texture_normals", TORCH_FN(texture_normals_cpu)); }

}  // namespace

TextureSpace::TextureSpace(const TriangleMesh& mesh, int size, int padding)
    : TextureSpace(RenderMesh(mesh), size, padding) {}

TextureSpace::TextureSpace(const RenderMesh& mesh, int size, int padding) : mesh_(mesh), size_(size) {
  if (size < 1 || size > kernels::kMaxImage || padding < 0 || padding > 64) {
    fail<UsageError>(
        "TextureSpace: {} texels with a padding of {}; a map has 1 to {} texels per side and a padding "
        "of 0 to 64",
        size, padding, kernels::kMaxImage);
  }
  if (!mesh.has_uvs()) {
    fail<UsageError>("TextureSpace: the mesh has no UVs, so there is no texture space; give it `vt` coordinates");
  }
  assign_texels(padding);
  find_runs();
}

void TextureSpace::assign_texels(int padding) {
  const TexelMap map = cover(mesh_, size_);
  const std::int64_t texels = static_cast<std::int64_t>(size_) * size_;
  mask_ = torch::empty({size_, size_}, torch::kBool);
  bool* covered = mask_.data_ptr<bool>();
  std::vector<std::int64_t> source;  // of each texel with a value
  lookup_ = torch::empty({texels}, torch::kInt64);
  std::int64_t* lookup = lookup_.data_ptr<std::int64_t>();
  for (std::int64_t i = 0; i < texels; ++i) {
    covered[i] = map.face[i] >= 0;
    const std::int64_t from =
        covered[i] ? i : nearest_covered(map, static_cast<int>(i % size_), static_cast<int>(i / size_), padding);
    lookup[i] = from < 0 ? -1 : static_cast<std::int64_t>(source.size());
    if (from >= 0) source.push_back(from);
  }
  const auto count = static_cast<std::int64_t>(source.size());
  if (count == 0) {
    fail<UsageError>("TextureSpace: no face covers the centre of a texel of a map of {} x {}; are the UVs in 0..1?",
                     size_, size_);
  }
  for (std::int64_t i = 0; i < texels; ++i) lookup[i] = lookup[i] < 0 ? count : lookup[i];
  corners_ = torch::empty({3, count}, torch::kInt64);
  weights_ = torch::empty({3, count, 1}, torch::kFloat64);
  const std::int32_t* faces = mesh_.faces.data_ptr<std::int32_t>();
  for (std::int64_t i = 0; i < count; ++i) {
    const auto from = as_size(source[i]);
    for (std::int64_t k = 0; k < 3; ++k) {
      corners_.data_ptr<std::int64_t>()[k * count + i] = faces[3 * static_cast<std::int64_t>(map.face[from]) + k];
      weights_.data_ptr<double>()[k * count + i] = map.weights[from][k];
    }
  }
}

void TextureSpace::find_runs() {
  const std::int64_t *lookup = lookup_.data_ptr<std::int64_t>(), none = corners_.size(1);
  std::vector<std::int32_t> runs;
  std::vector<std::int64_t> source;  // of each texel with a value, in the order of the map
  for (std::int64_t i = 0; i < lookup_.size(0); ++i) {
    if (lookup[i] == none) continue;
    if (i % size_ == 0 || lookup[i - 1] == none) {
      runs.push_back(static_cast<std::int32_t>(i));
      runs.push_back(static_cast<std::int32_t>(source.size()));
    }
    source.push_back(lookup[i]);
  }
  const Tensor texels = torch::tensor(source, torch::kInt64);
  runs_ = {torch::tensor(runs, torch::kInt32).view({-1, 2}),
           corners_.index_select(1, texels).to(torch::kInt32).contiguous(),
           weights_.squeeze(2).index_select(1, texels).to(torch::kFloat32).contiguous()};
}

/// @param values [B,N,3] of the vertices @return [B,P,3]
Tensor TextureSpace::interpolate(const Tensor& values) const {
  const Tensor weights = weights_.to(values.dtype());
  Tensor sum = values.index_select(1, corners_[0]) * weights[0];
  for (int k = 1; k < 3; ++k) sum = sum + values.index_select(1, corners_[k]) * weights[k];
  return sum;
}

/// @param texels [B,P,3] @return [B,3,T,T]
Tensor TextureSpace::to_map(const Tensor& texels) const {
  const Tensor background = torch::zeros_like(texels.slice(1, 0, 1));
  const Tensor channels = torch::cat({texels, background}, 1).transpose(1, 2);
  return channels.index_select(2, lookup_).unflatten(2, {size_, size_});
}

Tensor TextureSpace::normals(const Tensor& vertices) const {
  const Tensor n = interpolate(vertex_normal_sums(vertices, mesh_));
  const Tensor square = n.square().sum(2, true);
  const Tensor solid = square > 1e-30;
  const Tensor length = torch::where(solid, square, torch::ones_like(square)).sqrt();
  return to_map(torch::where(solid, n / length, torch::zeros_like(n)));
}

Tensor TextureSpace::normals_without_gradient(const Tensor& vertices) const {
  static const auto op = find_op<decltype(texture_normals_cpu)>("doppel::texture_normals");
  return op.call(vertices, {mesh_.face_records, mesh_.incident_offsets, mesh_.incident_faces}, runs_, size_);
}

TexelPoints TextureSpace::points() const {
  const Tensor texel = mask_.flatten().nonzero().squeeze(1), at = lookup_.index_select(0, texel);
  return {texel, corners_.index_select(1, at).t().contiguous(),
          weights_.squeeze(2).index_select(1, at).t().to(torch::kFloat32).contiguous()};
}

Tensor TextureSpace::positions(const Tensor& vertices) const {
  check_shape("TextureSpace", "vertices", vertices, {-1, mesh_.num_vertices, 3}, "[B,N,3]");
  return to_map(interpolate(vertices));
}

}  // namespace doppel
