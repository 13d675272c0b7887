#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/layers/op_support.h"
#include "doppel/nets/radiance_field.h"

namespace doppel {

using torch::Tensor;

namespace {

/// The state of one call: the surface, and one chunk of rays after the other.
class FieldPainter {
 public:
  FieldPainter(RadianceField& field, const ClosestPoint& closest, const FieldSurface& surface,
               const FieldImageOptions& options)
      : field_(field),
        trunk_(field->trunk_layers()),
        options_(options),
        surface_(closest->surface()),
        values_(surface.values.contiguous()) {
    surface_.move(positions_of(surface.vertices));
  }

  /// @param samples of the chunk's rays
  RenderedRays draw(const Tensor& origin, const Tensor& direction, const RaySamples& samples) {
    const int64_t R = samples.t.size(0), K = samples.t.size(1);
    points_ = samples.points(origin, direction).contiguous();
    hits_.assign(as_size(R * K), ClosedSurface::Hit{});
    Tensor density = torch::zeros({R * K});
    const Evaluated first = evaluate(first_samples(R, K), density);
    const Evaluated second = evaluate(second_samples(density, samples), density);
    const Tensor rows = torch::cat({first.rows, second.rows}), hidden = torch::cat({first.hidden, second.hidden});
    const Tensor weights = volume_weights(density.view({R, K}), samples).flatten();
    const Tensor seen = (weights.index_select(0, rows) > options_.least_weight).nonzero().squeeze(1);
    const Tensor seen_rows = rows.index_select(0, seen);
    const Tensor view = field_->view_term(direction).index_select(0, torch::div(seen_rows, K, "floor"));
    const Tensor colour = torch::zeros({R * K, 3});
    colour.index_copy_(0, seen_rows, field_->colour(hidden.index_select(0, seen), view));
    return render_volume(density.view({R, K}), colour.view({R, K, 3}), samples);
  }

 private:
  /// Samples that went through the network.
  struct Evaluated {
    Tensor rows;    ///< int64 [S] of [R*K]
    Tensor hidden;  ///< [S,width]
  };

  bool in_first_pass(int64_t k) const { return k % options_.first_pass == options_.first_pass / 2; }

  /// The samples of the first pass, ray by ray.
  std::vector<int64_t> first_samples(int64_t R, int64_t K) const {
    std::vector<int64_t> chosen;
    for (int64_t i = 0; i < R * K; ++i)
      if (in_first_pass(i % K)) chosen.push_back(i);
    return chosen;
  }

  /// The other samples that are neither in empty space nor behind opaque samples.
  /// @param density [R*K] of the first pass
  std::vector<int64_t> second_samples(const Tensor& density, const RaySamples& samples) const {
    const int64_t R = samples.t.size(0), K = samples.t.size(1), step = options_.first_pass;
    const Tensor lengths = samples.step().expand({R, K}).contiguous();
    std::vector<int64_t> chosen;
    for (int64_t ray = 0; ray < R; ++ray) {
      const float *sigma = density.data_ptr<float>() + ray * K, *length = lengths.data_ptr<float>() + ray * K;
      const auto absorbed = [&](int64_t k) {  // sigma times the length of the cells that a first sample stands for
        return k >= 0 && k < K ? static_cast<double>(sigma[k] * length[k]) * static_cast<double>(step) : 0.0;
      };
      double before = 0.0;  // absorbed by the first samples before the left neighbour
      for (int64_t left = step / 2 - step; left < K; left += step) {
        if (before > -std::log(options_.opaque)) break;
        const bool empty = absorbed(left) < options_.empty && absorbed(left + step) < options_.empty;
        for (int64_t k = std::max<int64_t>(left + 1, 0); k < std::min(left + step, K) && !empty; ++k)
          chosen.push_back(ray * K + k);
        before += absorbed(left);
      }
    }
    return chosen;
  }

  /// Evaluates the chosen samples within the shell and writes their densities.
  Evaluated evaluate(const std::vector<int64_t>& chosen, Tensor& density) {
    search(chosen);
    const Tensor rows = torch::tensor(near_, torch::kInt64);
    Evaluated result{rows, trunk_.forward(inputs())};
    density.index_copy_(0, rows, field_->density(result.hidden));
    return result;
  }

  /// Closest points of the chosen samples; `near_` lists those within the shell.
  void search(const std::vector<int64_t>& chosen) {
    const auto count = static_cast<int64_t>(chosen.size());
    at::parallel_for(0, count, 64, [&](int64_t begin, int64_t end) {
      int near_face = -1;
      for (int64_t i = begin; i < end; ++i) {
        const float* p = points_.data_ptr<float>() + 3 * chosen[as_size(i)];
        ClosedSurface::Hit& hit = hits_[as_size(chosen[as_size(i)])];
        hit = surface_.closest({p[0], p[1], p[2]}, near_face);
        near_face = hit.face;
      }
    });
    const RadianceFieldConfig& config = field_->config();
    near_.clear();
    for (const int64_t i : chosen)
      if (hits_[as_size(i)].distance <= config.t_ma + config.margin &&
          hits_[as_size(i)].distance >= -config.t_mi - config.margin)
        near_.push_back(i);
  }

  /// The network's inputs for the samples in `near_`.
  Tensor inputs() const {
    const RadianceFieldConfig& config = field_->config();
    const int64_t count = static_cast<int64_t>(near_.size()), width = field_->num_inputs();
    Tensor result = torch::empty({count, width});
    at::parallel_for(0, count, 256, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) {
        const ClosedSurface::Hit& hit = hits_[near_[i]];
        float* row = result.data_ptr<float>() + i * width;
        row = interpolate(hit, 0, config.features, row);
        if (config.place_octaves > 0) {
          float place[3];
          interpolate(hit, config.features, 3, place);
          for (int axis = 0; axis < 3; ++axis) encode(place[axis], config.place_octaves, 3, row + axis);
          row += 3 * (1 + 2 * config.place_octaves);
        }
        const double unit = hit.distance < 0 ? config.t_mi : config.t_ma;
        encode(std::clamp(hit.distance / unit, -1.0, 1.0), config.distance_octaves, 1, row);
      }
    });
    return result;
  }

  /// Writes `count` interpolated vertex values, starting at value `first`. @return end of the written values
  float* interpolate(const ClosedSurface::Hit& hit, int64_t first, int64_t count, float* row) const {
    const int64_t H = values_.size(1);
    const Triangle& face = surface_.faces()[hit.face];
    const float* from = values_.data_ptr<float>() + first;
    const float *a = from + H * face[0], *b = from + H * face[1], *c = from + H * face[2];
    const auto u = static_cast<float>(hit.weights[0]), v = static_cast<float>(hit.weights[1]),
               w = static_cast<float>(hit.weights[2]);
    for (int64_t h = 0; h < count; ++h) row[h] = u * a[h] + v * b[h] + w * c[h];
    return row + count;
  }

  /// positional_encoding of one of `channels` interleaved numbers; octaves are computed by doubling the angle.
  static void encode(double x, int octaves, int channels, float* row) {
    row[0] = static_cast<float>(x);
    double sine = std::sin(M_PI * x), cosine = std::cos(M_PI * x);
    for (int k = 0; k < octaves; ++k) {
      row[channels * (1 + 2 * k)] = static_cast<float>(sine);
      row[channels * (2 + 2 * k)] = static_cast<float>(cosine);
      const double twice = 2.0 * sine * cosine;
      cosine = cosine * cosine - sine * sine;
      sine = twice;
    }
  }

  RadianceField field_;
  DenseLayers trunk_;
  FieldImageOptions options_;
  ClosedSurface surface_;
  Tensor values_;                         ///< [N,H]
  Tensor points_;                         ///< [R,K,3] of the chunk
  std::vector<ClosedSurface::Hit> hits_;  ///< [R*K]
  std::vector<int64_t> near_;
};

void check_arguments(const RadianceField& field, const ClosestPoint& closest, const FieldSurface& surface,
                     const Tensor& origin, const Tensor& direction, const Tensor& near, const Tensor& far,
                     const FieldImageOptions& options) {
  constexpr const char* kName = "draw_field";
  const int64_t N = closest->num_vertices();
  check_shape(kName, "vertices", surface.vertices, {N, 3}, "[N,3]");
  check_shape(kName, "values", surface.values, {N, field->config().vertex_values()}, "[N,H]");
  check_shape(kName, "origin", origin, {3}, "[3]");
  check_shape(kName, "direction", direction, {-1, 3}, "[R,3]");
  check_shape(kName, "near", near, {direction.size(0)}, "[R]");
  check_shape(kName, "far", far, {direction.size(0)}, "[R]");
  for (const Tensor& tensor : {surface.vertices, surface.values, origin, direction, near, far}) {
    if (tensor.scalar_type() != torch::kFloat32 || !tensor.device().is_cpu())
      fail<UsageError>("{}: everything must be float32 on the CPU, found {} on {}; render_field takes all types", kName,
                       describe(tensor), tensor.device().str());
    if (!tensor.isfinite().all().item<bool>())
      fail<UsageError>("{}: vertices, vertex values or rays contain numbers that are not finite", kName);
  }
  if (options.samples < 1 || options.rays_at_once < 1 || options.first_pass < 1)
    fail<UsageError>("{}: {} samples, {} rays at once and one of {} samples first; all must be at least 1", kName,
                     options.samples, options.rays_at_once, options.first_pass);
}

}  // namespace

FieldPixels draw_field(RadianceField& field, const ClosestPoint& closest, const FieldSurface& surface,
                       const Tensor& origin, const Tensor& direction, const Tensor& near, const Tensor& far,
                       const FieldImageOptions& options) {
  const torch::NoGradGuard no_grad;
  check_arguments(field, closest, surface, origin, direction, near, far, options);
  const int64_t R = direction.size(0);
  FieldPixels image{torch::empty({R, 3}), torch::empty({R}), torch::empty({R})};
  FieldPainter painter(field, closest, surface, options);
  for (int64_t first = 0; first < R; first += options.rays_at_once) {
    const int64_t count = std::min(options.rays_at_once, R - first);
    const auto part = [&](const Tensor& of) { return of.narrow(0, first, count); };
    const RaySamples samples = sample_cells(part(near), part(far), options.samples);
    const RenderedRays seen = painter.draw(origin, part(direction), samples);
    part(image.colour).copy_(seen.colour);
    part(image.opacity).copy_(seen.opacity);
    part(image.depth).copy_(seen.depth);
  }
  return image;
}

}  // namespace doppel
