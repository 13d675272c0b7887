#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/library.h>
#include <torch/types.h>

#include <algorithm>
#include <atomic>
#include <memory>

#include "doppel/core/as_size.h"
#include "doppel/core/tensor/op.h"
#include "doppel/render/lease.h"
#include "doppel/render/raster/view_workers.h"
#include "doppel/render/recycled.h"
#include "doppel/render/shading/shading_kernel.h"
#include "doppel/render/shading/shading_terms.h"
#include "doppel/render/shading/vertex_normals.h"

namespace doppel::shading {
namespace {

using kernels::FaceGradient;
using kernels::kTile;
using kernels::RasterView;
using kernels::ShadeView;
using kernels::TexelGradient;
using kernels::TileGradient;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

// --- scratch ---------------------------------------------------------------------------------------------------------

/// Growing memory without initialisation.
template <typename T>
class Arena {
 public:
  /// Reserves room for `more` items beyond size() and moves the existing items.
  T* room(std::size_t more) {
    if (size_ + more > capacity_) {
      const std::size_t capacity = std::max(size_ + more, 2 * capacity_);
      std::unique_ptr<T[]> bigger(new T[capacity]);
      std::copy_n(items_.get(), size_, bigger.get());
      items_ = std::move(bigger);
      capacity_ = capacity;
    }
    return items_.get() + size_;
  }
  void add(std::size_t count) { size_ += count; }
  void clear() { size_ = 0; }
  std::size_t size() const { return size_; }
  const T* data() const { return items_.get(); }

 private:
  std::unique_ptr<T[]> items_;
  std::size_t size_ = 0, capacity_ = 0;
};

/// The gradients that one thread collects.
struct Collected {
  Arena<FaceGradient> faces;
  Arena<TexelGradient> texels;
  std::vector<std::int32_t> slot_of_face;
};

/// The location of a tile's part in a thread's collection.
struct TilePart {
  std::size_t thread = 0, first_face = 0, first_texel = 0;
  std::int32_t num_faces = 0, num_texels = 0;
};

struct Workspace {
  render::ViewWorkers workers;
  std::vector<Collected> collected;
  std::vector<TilePart> parts;
  std::vector<double> lighting;
  std::vector<float> face_normals, sums;
};

/// A workspace for one call. All serve every call.
using WorkspaceLease = render::Lease<Workspace>;

// --- arguments -------------------------------------------------------------------------------------------------------

constexpr std::int64_t kItemsPerThread = 4096;  ///< vertices or faces: fewer do not pay for another thread

Tensor floats(const Tensor& t) { return t.to(torch::kFloat32).contiguous(); }

const float* data_or_null(const Tensor& t) { return t.defined() ? t.data_ptr<float>() : nullptr; }

/// The arguments of one call in the form of the kernels.
struct Scene {
  Tensor vertices, texture, lighting, projection, faces, uvs, offsets, incident;
  std::vector<ViewGeometry> geometry;
  std::int64_t batch, cameras, num_vertices, num_faces, height, width;
  bool nearest = false, flip = false;

  Scene(const Tensor& vertices_in, const OptionalTensor& texture_in, const OptionalTensor& lighting_in,
        const Tensor& projection_in, const Tensor& faces_in, const OptionalTensor& uvs_in, const Tensor& offsets_in,
        const Tensor& incident_in, std::int64_t image_height, std::int64_t image_width)
      : vertices(floats(vertices_in)),
        projection(floats(projection_in)),
        faces(faces_in.contiguous()),
        offsets(offsets_in.contiguous()),
        incident(incident_in.contiguous()),
        batch(vertices.size(0)),
        cameras(projection.size(1)),
        num_vertices(vertices.size(1)),
        num_faces(faces.size(0)),
        height(image_height),
        width(image_width) {
    if (texture_in.has_value() && texture_in->defined()) texture = floats(*texture_in);
    if (lighting_in.has_value() && lighting_in->defined()) lighting = floats(*lighting_in);
    if (uvs_in.has_value() && uvs_in->defined()) uvs = floats(*uvs_in);
    TORCH_CHECK(!texture.defined() || uvs.defined(), "doppel::shade: a texture needs uv_records");
    geometry = view_geometry(view_tensors("doppel::shade", projection));
  }

  std::int64_t views() const { return batch * cameras; }
  std::int64_t tiles_x() const { return (width + kTile - 1) / kTile; }
  std::int64_t tiles() const { return tiles_x() * ((height + kTile - 1) / kTile); }
  std::int64_t texture_of(std::int64_t view) const {
    return texture.size(0) == 1 ? 0 : texture.size(0) == batch ? view / cameras : view;
  }
  const float* vertices_of(std::int64_t item) const { return vertices.data_ptr<float>() + 3 * num_vertices * item; }
  const float* matrix_of(std::int64_t view) const { return projection.data_ptr<float>() + 12 * view; }
  kernels::NormalMesh normal_mesh(std::int64_t item) const {
    return {vertices_of(item), faces.data_ptr<std::int32_t>(), offsets.data_ptr<std::int32_t>(),
            incident.data_ptr<std::int32_t>()};
  }

  /// @param normals [B,N,4], used when there is lighting
  ShadeView view(std::int64_t v, const RasterView* raster, const Tensor& normals) const {
    ShadeView out;
    out.raster = raster;
    if (lighting.defined()) {
      out.normals = normals.data_ptr<float>() + 4 * num_vertices * (v / cameras);
      out.lighting = lighting.data_ptr<float>() + 27 * (lighting.size(0) == 1 ? v % cameras : v);
    }
    if (texture.defined()) {
      out.texture_height = static_cast<int>(texture.size(1));
      out.texture_width = static_cast<int>(texture.size(2));
      out.texture = texture.data_ptr<float>() + 3 * texture.size(1) * texture.size(2) * texture_of(v);
      out.uvs = data_or_null(uvs);
    }
    out.nearest = nearest;
    out.flip = flip;
    const ViewGeometry& g = geometry[v];
    std::copy(g.ray.begin(), g.ray.end(), out.ray);
    std::copy(g.centre.begin(), g.centre.end(), out.centre);
    return out;
  }

  /// The part of a view that the backward kernels read.
  RasterView raster_view(std::int64_t v) const {
    RasterView out;
    out.vertices = vertices_of(v / cameras);
    std::copy_n(matrix_of(v), 12, out.matrix);
    out.faces = faces.data_ptr<std::int32_t>();
    out.width = static_cast<int>(width);
    out.height = static_cast<int>(height);
    return out;
  }
};

// --- forward ---------------------------------------------------------------------------------------------------------

void compute_normals(const Scene& scene, Workspace& workspace, Tensor& normals) {
  workspace.face_normals.resize(4 * scene.num_faces);
  float* of_faces = workspace.face_normals.data();
  for (std::int64_t b = 0; b < scene.batch; ++b) {
    render::sum_vertex_normals(scene.normal_mesh(b), scene.num_faces, scene.num_vertices, of_faces,
                               normals.data_ptr<float>() + 4 * scene.num_vertices * b);
  }
}

/// Draws every tile; colour, mask and fragments may be undefined.
void draw(const Scene& scene, Workspace& workspace, const Tensor& normals, double z_near, const Tensor& colour,
          const Tensor& mask, const Fragments& fragments) {
  const std::int64_t pixels = scene.height * scene.width, words = kernels::fragment_words();
  float* colours = colour.defined() ? colour.data_ptr<float>() : nullptr;
  auto* masks = mask.defined() ? reinterpret_cast<std::uint8_t*>(mask.data_ptr<bool>()) : nullptr;
  std::int32_t* records = fragments.defined() ? fragments.records.data_ptr<std::int32_t>() : nullptr;
  std::int32_t* counts = fragments.defined() ? fragments.counts.data_ptr<std::int32_t>() : nullptr;
  workspace.workers.run(
      scene.views(),
      [&](render::ViewPass& pass, std::int64_t v, int chunks) {
        pass.begin(scene.faces.data_ptr<std::int32_t>(), scene.num_faces, scene.vertices_of(v / scene.cameras),
                   scene.num_vertices, scene.matrix_of(v), static_cast<int>(scene.width),
                   static_cast<int>(scene.height), static_cast<float>(z_near), false, chunks);
      },
      [&](const render::ViewPass& pass, std::int64_t v, int tile, std::int64_t thread) {
        kernels::TileBuffer& buffer = workspace.workers.buffer(thread);
        const kernels::TileRect rect = pass.draw_tile(tile, buffer);
        const ShadeView view = scene.view(v, &pass.view(), normals);
        const std::int64_t at = scene.tiles() * v + tile;
        const int x0 = tile % pass.tiles_x() * kTile, y0 = tile / pass.tiles_x() * kTile;
        const std::int64_t first = pixels * v + y0 * scene.width + x0;
        const kernels::TileImage image{colours ? colours + 3 * first : nullptr, masks ? masks + first : nullptr,
                                       scene.width};
        const std::int32_t count =
            kernels::shade_tile(view, x0, y0, rect, buffer, image, records ? records + words * at : nullptr);
        if (counts) counts[at] = count;
      });
}

Fragments new_fragments(const Scene& scene) {
  return {render::recycled_empty({scene.views(), scene.tiles(), kernels::fragment_words()}, torch::kInt32),
          torch::empty({scene.views(), scene.tiles()}, torch::kInt32)};
}

/// @return colour, mask, normal sums [B,N,4], fragment records and counts (empty unless `keep`)
std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor> shade_cpu(const Tensor& vertices, const OptionalTensor& texture,
                                                             const OptionalTensor& lighting, const Tensor& projection,
                                                             const Tensor& faces, const OptionalTensor& uvs,
                                                             const Tensor& offsets, const Tensor& incident,
                                                             std::int64_t height, std::int64_t width, bool nearest,
                                                             bool flip, double z_near, bool keep) {
  Scene scene(vertices, texture, lighting, projection, faces, uvs, offsets, incident, height, width);
  scene.nearest = nearest;
  scene.flip = flip;
  const WorkspaceLease workspace;
  Tensor normals = torch::empty({scene.lighting.defined() ? scene.batch : 0, scene.num_vertices, 4}, torch::kFloat32);
  if (scene.lighting.defined()) compute_normals(scene, *workspace, normals);
  const Tensor colour = render::recycled_empty({scene.batch, scene.cameras, height, width, 3}, torch::kFloat32);
  const Tensor mask = render::recycled_empty({scene.batch, scene.cameras, height, width}, torch::kBool);
  Fragments fragments;
  if (keep) fragments = new_fragments(scene);
  draw(scene, *workspace, normals, z_near, colour, mask, fragments);
  if (!keep) fragments = {torch::empty({0}, torch::kInt32), torch::empty({0}, torch::kInt32)};
  return {colour, mask, normals, fragments.records, fragments.counts};
}

// --- supersampling ---------------------------------------------------------------------------------------------------

/// The cells of the tiles of one view (kernels::TileCells).
struct TiledCells {
  int factor;
  std::int64_t side;  ///< of a tile, cells
  Tensor sums;        ///< [tiles,side,side,4]
  std::vector<char> drawn;

  TiledCells(const Scene& scene, int samples)
      : factor(samples),
        side((kTile - 1) / samples + 2),
        sums(render::recycled_empty({scene.tiles(), side, side, 4}, torch::kFloat32)),
        drawn(as_size(scene.tiles()), 0) {}
  float* of(std::int64_t tile) const { return sums.data_ptr<float>() + 4 * side * side * tile; }
};

/// Draws the samples of view v, one tile at a time, and adds them up in the cells.
void draw_cells(const Scene& scene, Workspace& workspace, const Tensor& normals, double z_near, std::int64_t v,
                TiledCells& cells) {
  std::fill(cells.drawn.begin(), cells.drawn.end(), 0);
  const int threads = std::max(at::get_num_threads(), 1);
  std::vector<float> colours(as_size(threads) * 3 * kTile * kTile);
  std::vector<std::uint8_t> masks(as_size(threads) * kTile * kTile);
  workspace.workers.run(
      1,
      [&](render::ViewPass& pass, std::int64_t, int chunks) {
        pass.begin(scene.faces.data_ptr<std::int32_t>(), scene.num_faces, scene.vertices_of(v / scene.cameras),
                   scene.num_vertices, scene.matrix_of(v), static_cast<int>(scene.width),
                   static_cast<int>(scene.height), static_cast<float>(z_near), false, chunks);
      },
      [&](const render::ViewPass& pass, std::int64_t, int tile, std::int64_t thread) {
        kernels::TileBuffer& buffer = workspace.workers.buffer(thread);
        const kernels::TileRect rect = pass.draw_tile(tile, buffer);
        if (rect.x1 <= rect.x0) return;
        const kernels::TileImage image{&colours[as_size(thread) * 3 * kTile * kTile],
                                       &masks[as_size(thread) * kTile * kTile], kTile};
        const int x0 = tile % pass.tiles_x() * kTile, y0 = tile / pass.tiles_x() * kTile;
        kernels::shade_tile(scene.view(v, &pass.view(), normals), x0, y0, rect, buffer, image, nullptr);
        std::fill_n(cells.of(tile), 4 * cells.side * cells.side, 0.0f);
        kernels::sum_samples(image, x0, y0, rect, {cells.factor, static_cast<int>(cells.side), cells.of(tile)});
        cells.drawn[tile] = 1;
      });
}

/// Adds the cells of a tile that lie in row Y of the averaged image.
void add_cells(const TiledCells& cells, std::int64_t tile_x, std::int64_t tile_y, std::int64_t tile, std::int64_t Y,
               std::int64_t width, float* image, float* alpha) {
  const std::int64_t first = tile_x * kTile / cells.factor, row = Y - tile_y * kTile / cells.factor;
  const float* from = cells.of(tile) + 4 * cells.side * row;
  const float scale = 1.0f / static_cast<float>(cells.factor * cells.factor);
  const std::int64_t last = std::min(width, first + cells.side);
  for (std::int64_t X = first; X < last; ++X, from += 4) {
    for (int c = 0; c < 3; ++c) image[3 * X + c] += from[c] * scale;
    alpha[X] += from[3] * scale;
  }
}

/// The averaged image of a view, tile by tile in a fixed order.
void average_cells(const Scene& scene, const TiledCells& cells, float* image, float* alpha) {
  const std::int64_t width = scene.width / cells.factor, height = scene.height / cells.factor;
  const std::int64_t tiles_x = scene.tiles_x();
  at::parallel_for(0, height, 16, [&](std::int64_t begin, std::int64_t end) {
    std::fill(image + 3 * width * begin, image + 3 * width * end, 0.0f);
    std::fill(alpha + width * begin, alpha + width * end, 0.0f);
    for (std::int64_t Y = begin; Y < end; ++Y) {
      const std::int64_t last = ((Y + 1) * cells.factor - 1) / kTile;
      for (std::int64_t ty = Y * cells.factor / kTile; ty <= last; ++ty)
        for (std::int64_t tx = 0; tx < tiles_x; ++tx)
          if (cells.drawn[ty * tiles_x + tx])
            add_cells(cells, tx, ty, ty * tiles_x + tx, Y, width, image + 3 * width * Y, alpha + width * Y);
    }
  });
}

// --- backward --------------------------------------------------------------------------------------------------------

/// Runs kernel(view in item, tile, gradient) over the tiles of one batch item and stores the results in the order of
/// views and tiles.
template <typename Kernel>
void collect(const Scene& scene, Workspace& w, bool wants_faces, bool wants_texels, bool wants_lighting,
             const Kernel& kernel) {
  const std::int64_t tasks = scene.cameras * scene.tiles();
  const int threads = at::in_parallel_region() ? 1 : std::max(at::get_num_threads(), 1);
  if (w.collected.size() < as_size(threads)) w.collected.resize(threads);
  w.parts.assign(tasks, {});
  if (wants_lighting) w.lighting.assign(27 * tasks, 0.0);
  constexpr std::size_t kPixels = as_size(kTile) * kTile;
  std::atomic<std::int64_t> next{0};
  at::parallel_for(0, threads, 1, [&](std::int64_t first, std::int64_t last) {
    for (std::int64_t thread = first; thread < last; ++thread) {
      Collected& own = w.collected[thread];
      own.faces.clear();
      own.texels.clear();
      // Any index below the number of records is harmless, because a record holds its face.
      if (own.slot_of_face.size() < as_size(scene.num_faces)) {
        own.slot_of_face.resize(scene.num_faces, 0);
      }
      for (std::int64_t task = next++; task < tasks; task = next++) {
        TileGradient gradient;
        if (wants_faces) gradient.faces = own.faces.room(kPixels);
        if (wants_texels) gradient.texels = own.texels.room(kPixels);
        if (wants_lighting) gradient.lighting = w.lighting.data() + 27 * task;
        gradient.slot_of_face = own.slot_of_face.data();
        kernel(task / scene.tiles(), task % scene.tiles(), gradient);
        w.parts[task] = {as_size(thread), own.faces.size(), own.texels.size(), gradient.num_faces, gradient.num_texels};
        own.faces.add(as_size(gradient.num_faces));
        own.texels.add(as_size(gradient.num_texels));
      }
    }
  });
}

/// Gradient to the vertices of one batch item. Each thread has a range of vertices and reads all tiles in order.
void reduce_vertices(const Scene& scene, Workspace& w, std::int64_t item, bool through_normals, float* out) {
  const kernels::NormalMesh mesh = scene.normal_mesh(item);
  w.sums.resize(8 * scene.num_vertices);
  float* sums = w.sums.data();
  at::parallel_for(0, scene.num_vertices, kItemsPerThread / 4, [&](std::int64_t begin, std::int64_t end) {
    std::fill(sums + 8 * begin, sums + 8 * end, 0.0f);
    for (const TilePart& part : w.parts) {
      if (part.num_faces == 0) continue;
      kernels::add_face_gradients(w.collected[part.thread].faces.data() + part.first_face, part.num_faces, begin, end,
                                  sums);
    }
    if (!through_normals) kernels::vertex_gradients(mesh, sums, nullptr, begin, end, out);
  });
  if (!through_normals) return;
  w.face_normals.resize(4 * scene.num_faces);
  float* to_faces = w.face_normals.data();
  at::parallel_for(0, scene.num_faces, kItemsPerThread, [&](std::int64_t begin, std::int64_t end) {
    kernels::face_normal_gradients(mesh, sums, begin, end, to_faces);
  });
  at::parallel_for(0, scene.num_vertices, kItemsPerThread / 2, [&](std::int64_t begin, std::int64_t end) {
    kernels::vertex_gradients(mesh, sums, to_faces, begin, end, out);
  });
}

/// Gradient to the textures of the views of one batch item. Each thread has a range of rows.
void reduce_texels(const Scene& scene, const Workspace& w, std::int64_t item, float* gradient) {
  const std::int64_t rows = scene.texture.size(1), width = scene.texture.size(2), tiles = scene.tiles();
  at::parallel_for(
      0, rows, std::max<std::int64_t>(1, rows / at::get_num_threads()), [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t c = 0; c < scene.cameras; ++c) {
          float* out = gradient + 3 * rows * width * scene.texture_of(item * scene.cameras + c);
          for (std::int64_t t = 0; t < tiles; ++t) {
            const TilePart& part = w.parts[c * tiles + t];
            if (part.num_texels == 0) continue;
            kernels::add_texel_gradients(w.collected[part.thread].texels.data() + part.first_texel, part.num_texels,
                                         static_cast<int>(width), static_cast<int>(begin), static_cast<int>(end), out);
          }
        }
      });
}

/// Adds the tiles of each view in order, in double.
void reduce_lighting(const Scene& scene, const Workspace& w, std::int64_t item, double* gradient) {
  const bool shared = scene.lighting.size(0) == 1;
  for (std::int64_t c = 0; c < scene.cameras; ++c) {
    double* out = gradient + 27 * (shared ? c : item * scene.cameras + c);
    for (std::int64_t t = 0; t < scene.tiles(); ++t) {
      const double* in = w.lighting.data() + 27 * (c * scene.tiles() + t);
      for (int j = 0; j < 27; ++j) out[j] += in[j];
    }
  }
}

/// @return gradients to vertices, texture and lighting, empty where not wanted
std::tuple<Tensor, Tensor, Tensor> shade_backward_cpu(
    const Tensor& upstream_in, const Tensor& vertices, const OptionalTensor& texture, const OptionalTensor& lighting,
    const Tensor& projection, const Tensor& faces, const OptionalTensor& uvs, const Tensor& offsets,
    const Tensor& incident, const Tensor& normals, const Tensor& records, const Tensor& counts, bool nearest, bool flip,
    bool wants_vertices, bool wants_texture, bool wants_lighting) {
  Scene scene(vertices, texture, lighting, projection, faces, uvs, offsets, incident, upstream_in.size(2),
              upstream_in.size(3));
  scene.nearest = nearest;
  scene.flip = flip;
  wants_texture = wants_texture && scene.texture.defined();
  wants_lighting = wants_lighting && scene.lighting.defined();
  TORCH_CHECK(counts.sizes() == torch::IntArrayRef({scene.views(), scene.tiles()}),
              "doppel::shade_backward: fragments of another image, counts are ", counts.sizes());
  const Tensor upstream = floats(upstream_in);
  const WorkspaceLease w;
  Tensor to_vertices = torch::empty({0}), to_texture = torch::empty({0}), to_lighting = torch::empty({0});
  if (wants_vertices) to_vertices = torch::empty({scene.batch, scene.num_vertices, 3}, torch::kFloat32);
  if (wants_texture) to_texture = render::recycled_empty(scene.texture.sizes(), torch::kFloat32).zero_();
  if (wants_lighting) to_lighting = torch::zeros(scene.lighting.sizes(), torch::kFloat64);
  const std::int64_t words = kernels::fragment_words(), floats_per_view = 3 * scene.height * scene.width;
  for (std::int64_t b = 0; b < scene.batch; ++b) {
    collect(scene, *w, wants_vertices, wants_texture, wants_lighting,
            [&](std::int64_t c, std::int64_t tile, TileGradient& gradient) {
              const std::int64_t v = b * scene.cameras + c, at = v * scene.tiles() + tile;
              const RasterView raster = scene.raster_view(v);
              const ShadeView view = scene.view(v, &raster, normals);
              kernels::shade_tile_backward(
                  view, upstream.data_ptr<float>() + floats_per_view * v,
                  static_cast<int>(tile % scene.tiles_x()) * kTile, static_cast<int>(tile / scene.tiles_x()) * kTile,
                  records.data_ptr<std::int32_t>() + words * at, counts.data_ptr<std::int32_t>()[at], gradient);
            });
    if (wants_vertices) {
      reduce_vertices(scene, *w, b, scene.lighting.defined(),
                      to_vertices.data_ptr<float>() + 3 * scene.num_vertices * b);
    }
    if (wants_texture) reduce_texels(scene, *w, b, to_texture.data_ptr<float>());
    if (wants_lighting) reduce_lighting(scene, *w, b, to_lighting.data_ptr<double>());
  }
  return {to_vertices, to_texture, to_lighting.to(torch::kFloat32)};
}

// --- the moving target -----------------------------------------------------------------------------------------------

std::tuple<Tensor, Tensor> draw_fragments_cpu(const Tensor& vertices, const Tensor& projection, const Tensor& faces,
                                              std::int64_t height, std::int64_t width, double z_near) {
  const Tensor none = torch::empty({0}, torch::kInt32);
  const Scene scene(vertices, {}, {}, projection, faces, {}, none, none, height, width);
  const WorkspaceLease workspace;
  const Fragments fragments = new_fragments(scene);
  draw(scene, *workspace, {}, z_near, {}, {}, fragments);
  return {fragments.records, fragments.counts};
}

Tensor target_on_surface_backward_cpu(const Tensor& upstream_in, const Tensor& vertices, const Tensor& projection,
                                      const Tensor& faces, const Tensor& offsets, const Tensor& incident,
                                      const Tensor& target_in, const Tensor& records, const Tensor& counts,
                                      std::int64_t radius) {
  const Scene scene(vertices, {}, {}, projection, faces, {}, offsets, incident, target_in.size(2), target_in.size(3));
  const Tensor upstream = floats(upstream_in), target = floats(target_in);
  const WorkspaceLease w;
  const Tensor out = torch::empty({scene.batch, scene.num_vertices, 3}, torch::kFloat32);
  const std::int64_t words = kernels::fragment_words(), floats_per_view = 3 * scene.height * scene.width;
  for (std::int64_t b = 0; b < scene.batch; ++b) {
    collect(scene, *w, true, false, false, [&](std::int64_t c, std::int64_t tile, TileGradient& gradient) {
      const std::int64_t v = b * scene.cameras + c, at = v * scene.tiles() + tile;
      const RasterView raster = scene.raster_view(v);
      const kernels::TargetView view{&raster, target.data_ptr<float>() + floats_per_view * v, static_cast<int>(radius)};
      kernels::target_tile_backward(
          view, upstream.data_ptr<float>() + floats_per_view * v, static_cast<int>(tile % scene.tiles_x()) * kTile,
          static_cast<int>(tile / scene.tiles_x()) * kTile, records.data_ptr<std::int32_t>() + words * at,
          counts.data_ptr<std::int32_t>()[at], gradient);
    });
    reduce_vertices(scene, *w, b, false, out.data_ptr<float>() + 3 * scene.num_vertices * b);
  }
  return out;
}

// --- autograd --------------------------------------------------------------------------------------------------------

class ShadeFunction : public torch::autograd::Function<ShadeFunction> {
 public:
  static variable_list forward(AutogradContext* context, const Tensor& vertices, const OptionalTensor& texture,
                               const OptionalTensor& lighting, const Tensor& projection, const RenderMesh& mesh,
                               std::int64_t height, std::int64_t width, const ShadingOptions& options) {
    static const auto op = find_op<decltype(shade_cpu)>("doppel::shade");
    context->saved_data["nearest"] = options.nearest;
    context->saved_data["flip"] = options.flip_normals;
    context->saved_data["vertices"] = vertices.requires_grad();
    context->saved_data["texture"] = texture.has_value() && texture->requires_grad();
    context->saved_data["lighting"] = lighting.has_value() && lighting->requires_grad();
    at::AutoDispatchBelowADInplaceOrView guard;
    auto [colour, mask, normals, records, counts] = op.call(
        vertices, texture, lighting, projection, mesh.face_records, optional_of(mesh.uv_records), mesh.incident_offsets,
        mesh.incident_faces, height, width, options.nearest, options.flip_normals, options.z_near, true);
    context->save_for_backward({vertices, texture.value_or(Tensor()), lighting.value_or(Tensor()), projection,
                                mesh.face_records, mesh.uv_records, mesh.incident_offsets, mesh.incident_faces, normals,
                                records, counts});
    context->mark_non_differentiable({mask, records, counts});
    context->set_materialize_grads(false);  // otherwise backward receives zeros for the records
    return {colour, mask, records, counts};
  }

  static variable_list backward(AutogradContext* context, variable_list upstream) {
    static const auto op = find_op<decltype(shade_backward_cpu)>("doppel::shade_backward");
    const variable_list saved = context->get_saved_variables();
    const bool vertices = context->saved_data["vertices"].toBool(), texture = context->saved_data["texture"].toBool(),
               lighting = context->saved_data["lighting"].toBool();
    variable_list out(8);
    if (!upstream[0].defined()) return out;
    {
      at::AutoDispatchBelowADInplaceOrView guard;
      auto [to_vertices, to_texture, to_lighting] = op.call(
          upstream[0], saved[0], optional_of(saved[1]), optional_of(saved[2]), saved[3], saved[4],
          optional_of(saved[5]), saved[6], saved[7], saved[8], saved[9], saved[10],
          context->saved_data["nearest"].toBool(), context->saved_data["flip"].toBool(), vertices, texture, lighting);
      if (vertices) out[0] = to_vertices;
      if (texture) out[1] = to_texture;
      if (lighting) out[2] = to_lighting;
    }
    return once_differentiable(std::move(out), "shade");
  }
};

class TargetFunction : public torch::autograd::Function<TargetFunction> {
 public:
  static Tensor forward(AutogradContext* context, const Tensor& vertices, const Tensor& target,
                        const Tensor& projection, const RenderMesh& mesh, const Fragments& fragments, int radius) {
    context->saved_data["radius"] = static_cast<std::int64_t>(radius);
    context->save_for_backward({vertices, projection, mesh.face_records, mesh.incident_offsets, mesh.incident_faces,
                                target, fragments.records, fragments.counts});
    return target;
  }

  static variable_list backward(AutogradContext* context, variable_list upstream) {
    static const auto op = find_op<decltype(target_on_surface_backward_cpu)>("doppel::target_on_surface_backward");
    const variable_list saved = context->get_saved_variables();
    Tensor to_vertices;
    {
      at::AutoDispatchBelowADInplaceOrView guard;
      to_vertices = op.call(upstream[0], saved[0], saved[1], saved[2], saved[3], saved[4], saved[5], saved[6], saved[7],
                            context->saved_data["radius"].toInt());
    }
    variable_list out = once_differentiable({to_vertices}, "target_on_surface");
    return {out[0], upstream[0], Tensor(), Tensor(), Tensor(), Tensor()};
  }
};

bool needs_gradient(const Tensor& t) { return t.defined() && t.requires_grad(); }

}  // namespace

ShadedImage fused(const Tensor& vertices, const Tensor& texture, const Tensor& lighting_in, const Tensor& projection,
                  const RenderMesh& mesh, std::int64_t height, std::int64_t width, const ShadingOptions& options) {
  const Tensor lighting = options.lit ? lighting_in : Tensor();
  const bool gradient = torch::GradMode::is_enabled() &&
                        (needs_gradient(vertices) || needs_gradient(texture) || needs_gradient(lighting));
  if (!gradient) {
    static const auto op = find_op<decltype(shade_cpu)>("doppel::shade");
    at::AutoDispatchBelowADInplaceOrView guard;
    auto [colour, mask, normals, records, counts] =
        op.call(vertices, optional_of(texture), optional_of(lighting), projection, mesh.face_records,
                optional_of(mesh.uv_records), mesh.incident_offsets, mesh.incident_faces, height, width,
                options.nearest, options.flip_normals, options.z_near, false);
    return {colour, mask, {}};
  }
  const variable_list out = ShadeFunction::apply(vertices, optional_of(texture), optional_of(lighting), projection,
                                                 mesh, height, width, options);
  return {out[0], out[1], {out[2], out[3]}};
}

SupersampledImage fused_supersampled(const Tensor& vertices, const Tensor& texture, const Tensor& lighting,
                                     const Tensor& projection, const RenderMesh& mesh, std::int64_t height,
                                     std::int64_t width, int factor, const ShadingOptions& options) {
  Scene scene(vertices, optional_of(texture), optional_of(options.lit ? lighting : Tensor()), projection,
              mesh.face_records, optional_of(mesh.uv_records), mesh.incident_offsets, mesh.incident_faces, height,
              width);
  scene.nearest = options.nearest;
  scene.flip = options.flip_normals;
  const WorkspaceLease workspace;
  Tensor normals = torch::empty({scene.lighting.defined() ? scene.batch : 0, scene.num_vertices, 4}, torch::kFloat32);
  if (scene.lighting.defined()) compute_normals(scene, *workspace, normals);
  const std::int64_t rows = height / factor, columns = width / factor;
  SupersampledImage result{render::recycled_empty({scene.batch, scene.cameras, rows, columns, 3}, torch::kFloat32),
                           render::recycled_empty({scene.batch, scene.cameras, rows, columns}, torch::kFloat32)};
  TiledCells cells(scene, factor);
  for (std::int64_t v = 0; v < scene.views(); ++v) {
    draw_cells(scene, *workspace, normals, options.z_near, v, cells);
    average_cells(scene, cells, result.image.data_ptr<float>() + 3 * rows * columns * v,
                  result.alpha.data_ptr<float>() + rows * columns * v);
  }
  return result;
}

Tensor target_fused(const Tensor& vertices, const Tensor& projection, const RenderMesh& mesh, const Tensor& target,
                    const TargetOptions& options, const Fragments& drawn) {
  if (!torch::GradMode::is_enabled() || !vertices.requires_grad()) return target;
  Fragments fragments = drawn;
  if (!fragments.defined()) {
    static const auto op = find_op<decltype(draw_fragments_cpu)>("doppel::draw_fragments");
    at::AutoDispatchBelowADInplaceOrView guard;
    std::tie(fragments.records, fragments.counts) =
        op.call(vertices, projection, mesh.face_records, target.size(2), target.size(3), options.z_near);
  }
  return TargetFunction::apply(vertices, target, projection, mesh, fragments, options.radius);
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def(
      "shade(Tensor vertices, Tensor? texture, Tensor? lighting, Tensor projection, Tensor face_records, Tensor? "
      "uv_records, Tensor incident_offsets, Tensor incident_faces, int height, int width, bool nearest, bool flip, "
      "float z_near, bool keep) -> (Tensor colour, Tensor mask, Tensor normals, Tensor records, Tensor counts)");
  m.def(
      "shade_backward(Tensor upstream, Tensor vertices, Tensor? texture, Tensor? lighting, Tensor projection, Tensor "
      "face_records, Tensor? uv_records, Tensor incident_offsets, Tensor incident_faces, Tensor normals, Tensor "
      "records, Tensor counts, bool nearest, bool flip, bool wants_vertices, bool wants_texture, bool wants_lighting) "
      "-> (Tensor vertices, Tensor texture, Tensor lighting)");
  m.def(
      "draw_fragments(Tensor vertices, Tensor projection, Tensor face_records, int height, int width, float z_near) -> "
      "(Tensor records, Tensor counts)");
  m.def(
      "target_on_surface_backward(Tensor upstream, Tensor vertices, Tensor projection, Tensor face_records, Tensor "
      "incident_offsets, Tensor incident_faces, Tensor target, Tensor records, Tensor counts, int radius) -> Tensor");
}

TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("shade", &shade_cpu);
  m.impl("shade_backward", &shade_backward_cpu);
  m.impl("draw_fragments", &draw_fragments_cpu);
  m.impl("target_on_surface_backward", &target_on_surface_backward_cpu);
}

}  // namespace doppel::shading
