#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/library.h>

#include <algorithm>
#include <atomic>
#include <memory>

#include "doppel/core/as_size.h"
#include "doppel/core/tensor/op.h"
#include "doppel/render/lease.h"
#include "doppel/render/recycled.h"
#include "doppel/render/splats/splat_kernel.h"
#include "doppel/render/splats/splat_order.h"
#include "doppel/render/splats/splat_terms.h"

namespace doppel::splats {
namespace {

using kernels::SplatRecord;
using kernels::SplatScratch;
using kernels::SplatSums;
using kernels::SplatTile;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

constexpr std::int64_t kSplatsPerThread = 2048;  ///< fewer do not pay for another thread

/// Memory of one thread.
struct ThreadMemory {
  SplatScratch scratch;
  TileSort sort;
};
/// Memory that calls hand on to the next one.
struct Workspace {
  std::vector<TileEntry> entries;
  std::vector<std::unique_ptr<ThreadMemory>> threads;
};
using WorkspaceLease = render::Lease<Workspace>;

/// The arguments of one call in the form of the kernels.
struct Scene {
  Tensor positions, rotations, log_scales, opacities, harmonics, normals, projection, centre;
  std::int64_t batch, cameras, count;
  TileGrid grid;
  float z_near;

  Scene(const Tensor& positions_in, const Tensor& rotations_in, const Tensor& log_scales_in, const Tensor& opacities_in,
        const Tensor& harmonics_in, const OptionalTensor& normals_in, const Tensor& projection_in,
        const Tensor& centre_in, std::int64_t height, std::int64_t width, double near)
      : positions(positions_in.contiguous()),
        rotations(rotations_in.contiguous()),
        log_scales(log_scales_in.contiguous()),
        opacities(opacities_in.contiguous()),
        harmonics(harmonics_in.contiguous()),
        projection(projection_in.contiguous()),
        centre(centre_in.contiguous()),
        batch(positions.size(0)),
        cameras(projection.size(1)),
        count(positions.size(1)),
        grid{width, height},
        z_near(static_cast<float>(near)) {
    if (normals_in.has_value()) normals = normals_in->contiguous();
  }

  std::int64_t views() const { return batch * cameras; }
  kernels::SplatArrays arrays(std::int64_t item) const {
    const auto at = [&](const Tensor& t) {
      return t.defined() ? t.data_ptr<float>() + item * (t.numel() / batch) : nullptr;
    };
    return {at(positions), at(rotations), at(log_scales), at(opacities), at(harmonics), at(normals)};
  }
  kernels::SplatCamera camera(std::int64_t view) const {
    kernels::SplatCamera out{};
    std::copy_n(projection.data_ptr<double>() + 12 * view, 12, out.matrix);
    for (int d = 0; d < 3; ++d) out.centre[d] = static_cast<float>(centre.data_ptr<double>()[3 * view + d]);
    out.width = static_cast<int>(grid.width);
    out.height = static_cast<int>(grid.height);
    out.z_near = z_near;
    out.harmonics = static_cast<int>(harmonics.size(2));
    return out;
  }
};

/// What the forward pass of one view leaves for the backward pass: tensors of the op's result.
struct ViewState {
  static constexpr std::int64_t kTensors = 5;
  Tensor first, offsets;  ///< int32 [N+1], [tiles+1]: count_copies
  Tensor records;         ///< uint8 [N,64] SplatRecord
  Tensor order, slots;    ///< int32 [copies]: TileSort

  static ViewState from(const std::vector<Tensor>& tensors, std::int64_t view) {
    const Tensor* t = tensors.data() + kTensors * view;
    return {t[0], t[1], t[2], t[3], t[4]};
  }
  void append_to(std::vector<Tensor>& tensors) const {
    tensors.insert(tensors.end(), {first, offsets, records, order, slots});
  }
  std::int64_t copies() const { return order.size(0); }
  void sort(std::int64_t tile, TileSort& by, const Workspace& w) const {
    const std::int32_t* offset = offsets.data_ptr<std::int32_t>() + tile;
    by.sort(std::span(w.entries).subspan(as_size(offset[0]), as_size(offset[1] - offset[0])), offset[0],
            order.data_ptr<std::int32_t>() + offset[0], slots.data_ptr<std::int32_t>());
  }
  SplatTile tile(const TileGrid& grid, std::int64_t number) const {
    const std::int32_t* offset = offsets.data_ptr<std::int32_t>() + number;
    const int x = static_cast<int>(number % grid.columns()) * kernels::kSplatTileWidth,
              y = static_cast<int>(number / grid.columns()) * kernels::kSplatTileHeight;
    return {reinterpret_cast<const SplatRecord*>(records.data_ptr()),
            order.data_ptr<std::int32_t>() + offset[0],
            offset[1] - offset[0],
            x,
            y,
            std::min(x + kernels::kSplatTileWidth, static_cast<int>(grid.width)),
            std::min(y + kernels::kSplatTileHeight, static_cast<int>(grid.height)),
            grid.width};
  }
};

/// A part of a recycled tensor of one of few sizes, so that the next call finds memory of its size.
Tensor rounded_empty(std::int64_t rows, std::int64_t columns, torch::ScalarType type) {
  constexpr std::int64_t kRows = 16384;
  return render::recycled_empty({(rows + kRows - 1) / kRows * kRows, columns}, type).narrow(0, 0, rows);
}

ViewState project_view(const Scene& scene, std::int64_t view, Workspace& w) {
  const kernels::SplatArrays arrays = scene.arrays(view / scene.cameras);
  const kernels::SplatCamera camera = scene.camera(view);
  ViewState out;
  out.records = rounded_empty(scene.count, sizeof(SplatRecord), torch::kUInt8);
  const std::span records(reinterpret_cast<SplatRecord*>(out.records.data_ptr()), as_size(scene.count));
  at::parallel_for(0, scene.count, kSplatsPerThread, [&](std::int64_t begin, std::int64_t end) {
    kernels::project_splats(arrays, camera, begin, end, records.data());
  });
  out.first = rounded_empty(scene.count + 1, 1, torch::kInt32).view({-1});
  out.offsets = torch::empty({scene.grid.tiles() + 1}, torch::kInt32);
  auto *first = out.first.data_ptr<std::int32_t>(), *offsets = out.offsets.data_ptr<std::int32_t>();
  count_copies(records, scene.grid, first, offsets);
  const std::int32_t copies = first[scene.count];
  out.order = rounded_empty(copies, 1, torch::kInt32).view({-1});
  out.slots = rounded_empty(copies, 1, torch::kInt32).view({-1});
  w.entries.resize(as_size(copies));
  list_copies(records, scene.grid, offsets, w.entries.data());
  return out;
}

/// Runs work(tile, memory of the thread) for all tiles of an image.
template <typename Work>
void for_tiles(const TileGrid& grid, Workspace& w, const Work& work) {
  const int threads = at::in_parallel_region() ? 1 : std::max(at::get_num_threads(), 1);
  while (w.threads.size() < as_size(threads)) w.threads.push_back(std::make_unique<ThreadMemory>());
  std::atomic<std::int64_t> next{0};
  at::parallel_for(0, threads, 1, [&](std::int64_t first, std::int64_t last) {
    for (std::int64_t thread = first; thread < last; ++thread)
      for (std::int64_t tile = next++; tile < grid.tiles(); tile = next++) work(tile, *w.threads[thread]);
  });
}

float* plane(const Tensor& images, std::int64_t view, std::int64_t views) {
  return images.numel() > 0 ? images.data_ptr<float>() + images.numel() / views * view : nullptr;
}
kernels::SplatPlanes planes(const Tensor& colour, const Tensor& alpha, const Tensor& depth, std::int64_t view,
                            std::int64_t views) {
  return {plane(colour, view, views), plane(alpha, view, views), plane(depth, view, views)};
}

/// @return colour, alpha, depth (empty unless wanted), and the states of the views, four tensors each, if `keep`
std::tuple<Tensor, Tensor, Tensor, std::vector<Tensor>> draw_splats_cpu(
    const Tensor& positions, const Tensor& rotations, const Tensor& log_scales, const Tensor& opacities,
    const Tensor& harmonics, const OptionalTensor& normals, const Tensor& projection, const Tensor& centre,
    std::int64_t height, std::int64_t width, double z_near, bool depth_wanted, bool keep) {
  const Scene scene(positions, rotations, log_scales, opacities, harmonics, normals, projection, centre, height, width,
                    z_near);
  const WorkspaceLease w;
  const Tensor colour = render::recycled_empty({scene.batch, scene.cameras, height, width, 3}, torch::kFloat32);
  const Tensor alpha = render::recycled_empty({scene.batch, scene.cameras, height, width}, torch::kFloat32);
  const Tensor depth = depth_wanted
                           ? render::recycled_empty({scene.batch, scene.cameras, height, width}, torch::kFloat32)
                           : torch::empty({0}, torch::kFloat32);
  std::vector<Tensor> states;
  for (std::int64_t v = 0; v < scene.views(); ++v) {
    const ViewState state = project_view(scene, v, *w);
    const kernels::SplatPlanes image = planes(colour, alpha, depth, v, scene.views());
    for_tiles(scene.grid, *w, [&](std::int64_t number, ThreadMemory& memory) {
      state.sort(number, memory.sort, *w);
      kernels::draw_splat_tile(state.tile(scene.grid, number), image, memory.scratch);
    });
    if (keep) state.append_to(states);
  }
  return {colour, alpha, depth, states};
}

/// @return gradients to positions, rotations, log_scales, opacities and harmonics
std::tuple<Tensor, Tensor, Tensor, Tensor, Tensor> draw_splats_backward_cpu(
    const OptionalTensor& to_colour, const OptionalTensor& to_alpha, const OptionalTensor& to_depth,
    const Tensor& positions, const Tensor& rotations, const Tensor& log_scales, const Tensor& opacities,
    const Tensor& harmonics, const Tensor& projection, const Tensor& centre, const Tensor& colour, const Tensor& alpha,
    const Tensor& depth, const std::vector<Tensor>& states, double z_near) {
  const Scene scene(positions, rotations, log_scales, opacities, harmonics, {}, projection, centre, colour.size(2),
                    colour.size(3), z_near);
  const std::int64_t views = scene.views();
  TORCH_CHECK(states.size() == as_size(ViewState::kTensors * views),
              "doppel::draw_splats_backward: states of another image");
  const auto upstream_of = [](const OptionalTensor& t) {
    return t.has_value() ? t->contiguous() : torch::empty({0}, torch::kFloat32);
  };
  const Tensor upstream_colour = to_colour.has_value() ? to_colour->contiguous() : torch::zeros_like(colour);
  const Tensor upstream_alpha = upstream_of(to_alpha), upstream_depth = upstream_of(to_depth);
  std::vector<Tensor> out;
  for (const Tensor& t : {scene.positions, scene.rotations, scene.log_scales, scene.opacities, scene.harmonics})
    out.push_back(render::recycled_empty(t.sizes(), torch::kFloat32).zero_());
  const auto to = [&](int k, std::int64_t item) {
    return out[k].data_ptr<float>() + item * (out[k].numel() / scene.batch);
  };
  const WorkspaceLease w;
  for (std::int64_t v = 0; v < views; ++v) {
    const ViewState state = ViewState::from(states, v);
    const std::int64_t item = v / scene.cameras;
    const Tensor sums = rounded_empty(state.copies(), sizeof(SplatSums) / sizeof(float), torch::kFloat32);
    auto* sum_data = reinterpret_cast<SplatSums*>(sums.data_ptr<float>());
    const kernels::SplatPlanes image = planes(colour, alpha, depth, v, views),
                               upstream = planes(upstream_colour, upstream_alpha, upstream_depth, v, views);
    for_tiles(scene.grid, *w, [&](std::int64_t number, ThreadMemory& memory) {
      kernels::draw_splat_tile_backward(state.tile(scene.grid, number), {image.colour, image.alpha, image.depth},
                                        {upstream.colour, upstream.alpha, upstream.depth}, memory.scratch,
                                        sum_data + state.offsets.data_ptr<std::int32_t>()[number]);
    });
    const kernels::SplatArrays arrays = scene.arrays(item);
    const kernels::SplatCamera camera = scene.camera(v);
    const kernels::SplatSlots slots{state.first.data_ptr<std::int32_t>(), state.slots.data_ptr<std::int32_t>()};
    const kernels::SplatGradients gradients{to(0, item), to(1, item), to(2, item), to(3, item), to(4, item)};
    at::parallel_for(0, scene.count, kSplatsPerThread / 2, [&](std::int64_t begin, std::int64_t end) {
      kernels::project_splats_backward(arrays, camera, slots, sum_data, begin, end, gradients);
    });
  }
  return {out[0], out[1], out[2], out[3], out[4]};
}

// --- autograd --------------------------------------------------------------------------------------------------------

class DrawSplats : public torch::autograd::Function<DrawSplats> {
 public:
  static variable_list forward(AutogradContext* context, const Tensor& positions, const Tensor& rotations,
                               const Tensor& log_scales, const Tensor& opacities, const Tensor& harmonics,
                               const OptionalTensor& normals, const Cameras& cameras, std::int64_t height,
                               std::int64_t width, const SplatOptions& options) {
    static const auto op = find_op<decltype(draw_splats_cpu)>("doppel::draw_splats");
    context->saved_data["z_near"] = static_cast<double>(options.z_near);
    at::AutoDispatchBelowADInplaceOrView guard;
    auto [colour, alpha, depth, states] =
        op.call(positions, rotations, log_scales, opacities, harmonics, normals, cameras.projection, cameras.centre,
                height, width, options.z_near, options.depth, true);
    variable_list saved{positions, rotations,          log_scales,     opacities, harmonics,
                        colour,    cameras.projection, cameras.centre, alpha,     depth};
    saved.insert(saved.end(), states.begin(), states.end());
    context->save_for_backward(saved);
    context->set_materialize_grads(false);
    return {colour, alpha, depth};
  }

  static variable_list backward(AutogradContext* context, variable_list upstream) {
    static const auto op = find_op<decltype(draw_splats_backward_cpu)>("doppel::draw_splats_backward");
    const variable_list saved = context->get_saved_variables();
    variable_list out(10);
    if (!upstream[0].defined() && !upstream[1].defined() && !upstream[2].defined()) return out;
    {
      at::AutoDispatchBelowADInplaceOrView guard;
      std::tie(out[0], out[1], out[2], out[3], out[4]) =
          op.call(optional_of(upstream[0]), optional_of(upstream[1]), optional_of(upstream[2]), saved[0], saved[1],
                  saved[2], saved[3], saved[4], saved[6], saved[7], saved[5], saved[8], saved[9],
                  std::vector<Tensor>(saved.begin() + 10, saved.end()), context->saved_data["z_near"].toDouble());
    }
    return once_differentiable(std::move(out), "draw_splats");
  }
};

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def(
      "draw_splats(Tensor positions, Tensor rotations, Tensor log_scales, Tensor opacities, Tensor harmonics, "
      "Tensor? normals, Tensor projection, Tensor centre, int height, int width, float z_near, bool depth, bool keep) "
      "-> (Tensor colour, Tensor alpha, Tensor depth, Tensor[] states)");
  m.def(
      "draw_splats_backward(Tensor? to_colour, Tensor? to_alpha, Tensor? to_depth, Tensor positions, Tensor rotations, "
      "Tensor log_scales, Tensor opacities, Tensor harmonics, Tensor projection, Tensor centre, Tensor colour, "
      "Tensor alpha, Tensor depth, Tensor[] states, float z_near) -> (Tensor, Tensor, Tensor, Tensor, Tensor)");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("draw_splats", TORCH_FN(draw_splats_cpu));
  m.impl("draw_splats_backward", TORCH_FN(draw_splats_backward_cpu));
}

}  // namespace

SplatImage fused(const Splats& s, const Cameras& cameras, std::int64_t height, std::int64_t width,
                 const SplatOptions& options) {
  const bool gradient = torch::GradMode::is_enabled() &&
                        (s.positions.requires_grad() || s.rotations.requires_grad() || s.log_scales.requires_grad() ||
                         s.opacities.requires_grad() || s.harmonics.requires_grad());
  SplatImage out;
  if (gradient) {
    const variable_list images = DrawSplats::apply(s.positions, s.rotations, s.log_scales, s.opacities, s.harmonics,
                                                   optional_of(s.normals), cameras, height, width, options);
    out = {images[0], images[1], images[2]};
  } else {
    static const auto op = find_op<decltype(draw_splats_cpu)>("doppel::draw_splats");
    at::AutoDispatchBelowADInplaceOrView guard;
    auto [colour, alpha, depth, states] =
        op.call(s.positions, s.rotations, s.log_scales, s.opacities, s.harmonics, optional_of(s.normals),
                cameras.projection, cameras.centre, height, width, options.z_near, options.depth, false);
    out = {colour, alpha, depth};
  }
  if (!options.depth) out.depth = Tensor();
  return out;
}

}  // namespace doppel::splats
