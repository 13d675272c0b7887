#include <ATen/Parallel.h>

#include <Eigen/Core>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/nets/radiance_field.h"

namespace doppel {

using torch::Tensor;

namespace {

/// What all threads read.
struct Painted {
  RadianceFieldConfig config;
  RadianceFieldImpl::ImageLayers layers;
  ClosedSurface surface;
  Tensor values;  ///< [N,H] of the vertices
  FieldImageOptions options;
  double transparent;  ///< optical depth up to which a ray goes on

  Painted(const RadianceField& field, const ClosestPoint& closest, const FieldSurface& at,
          const FieldImageOptions& image)
      : config(field->config()),
        layers(field->image_layers()),
        surface(closest->surface()),
        values(at.values.contiguous()),
        options(image),
        transparent(-std::log(image.opaque)) {
    surface.move(positions_of(at.vertices));
    if (options.samples < 4 * options.first_pass) options.first_pass = 1;  // too few first samples to find empty space
  }

  int64_t encoded_direction() const { return layers.colour.inputs() - config.width; }
};

/// A few rays that one thread draws together.
struct RayGroup {
  Tensor origin;                     ///< [3]
  Tensor direction, near, far;       ///< [R,3], [R], [R]
  Tensor t;                          ///< [R,K]
  Tensor encoded = torch::Tensor();  ///< [R,E] directions, undefined if colours do not depend on them

  int64_t rays() const { return t.size(0); }
  int64_t samples() const { return t.size(1); }

  /// @param index ray * K + sample
  Eigen::Vector3d point(int64_t index) const {
    const float *o = origin.data_ptr<float>(), *d = direction.data_ptr<float>() + 3 * (index / samples());
    const float along = t.data_ptr<float>()[index];
    return {o[0] + along * d[0], o[1] + along * d[1], o[2] + along * d[2]};
  }
};

/// Writes `channels` interleaved numbers of positional_encoding for one number; octaves double the angle.
void encode(double x, int octaves, int channels, float* row) {
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

/// The working memory of one thread.
class RayPainter {
 public:
  explicit RayPainter(const Painted& painted) : painted_(painted) {}

  /// @param out the group's pixels
  void draw(const RayGroup& group, const FieldPixels& out) {
    evaluated_.clear();
    density_.assign(group.rays() * group.samples(), 0.0f);
    evaluate_first(group);
    evaluate_between(group);
    weights_.resize(density_.size());
    const int64_t K = group.samples();
    for (int64_t ray = 0; ray < group.rays(); ++ray) {
      const RaySums sums =
          render_ray(&density_[ray * K], group.t.data_ptr<float>() + ray * K, K, group.near.data_ptr<float>()[ray],
                     group.far.data_ptr<float>()[ray], &weights_[ray * K]);
      out.opacity.data_ptr<float>()[ray] = sums.opacity;
      out.depth.data_ptr<float>()[ray] = sums.depth;
    }
    add_colours(group, out.colour.data_ptr<float>());
  }

 private:
  /// The optical depth of the cells that a sample of the first pass stands for; 0 for samples outside of [0,K).
  double absorbed(const RayGroup& group, int64_t ray, int64_t k) const {
    const int64_t K = group.samples();
    if (k < 0 || k >= K) return 0.0;
    const float length = group.far.data_ptr<float>()[ray] - group.near.data_ptr<float>()[ray];
    return static_cast<double>(density_[ray * K + k] * std::max(length, 0.0f)) / static_cast<double>(K) *
           static_cast<double>(painted_.options.first_pass);
  }

  /// Evaluates one of `first_pass` samples of each ray, a few at a time, until the ray is opaque.
  void evaluate_first(const RayGroup& group) {
    const int64_t step = painted_.options.first_pass, K = group.samples();
    constexpr int64_t kAtOnce = 3;
    std::vector<double> passed(group.rays(), 0.0);  // optical depth so far
    for (int64_t begin = step / 2; begin < K; begin += kAtOnce * step) {
      const int64_t end = std::min(begin + kAtOnce * step, K);
      chosen_.clear();
      for (int64_t ray = 0; ray < group.rays(); ++ray)
        for (int64_t k = begin; k < end && passed[ray] <= painted_.transparent; k += step)
          chosen_.push_back(ray * K + k);
      evaluate(group);
      for (const int64_t index : chosen_) passed[index / K] += absorbed(group, index / K, index % K);
    }
  }

  /// Evaluates the other samples that are neither in empty space nor behind opaque samples.
  void evaluate_between(const RayGroup& group) {
    const int64_t step = painted_.options.first_pass, K = group.samples();
    chosen_.clear();
    for (int64_t ray = 0; ray < group.rays(); ++ray) {
      double before = 0.0;  // absorbed by the first samples before the left neighbour
      for (int64_t left = step / 2 - step; left < K && before <= painted_.transparent; left += step) {
        const double here = absorbed(group, ray, left), next = absorbed(group, ray, left + step);
        const bool empty = here < painted_.options.empty && next < painted_.options.empty;
        for (int64_t k = std::max<int64_t>(left + 1, 0); k < std::min(left + step, K) && !empty; ++k)
          chosen_.push_back(ray * K + k);
        before += here;
      }
    }
    evaluate(group);
  }

  /// Hidden values and densities of the chosen samples within the shell. Appends them to `evaluated_`.
  void evaluate(const RayGroup& group) {
    const RadianceFieldConfig& config = painted_.config;
    const int64_t width = config.width, columns = painted_.layers.trunk.inputs();
    const std::size_t first = evaluated_.size();
    grow(inputs_, as_size(columns) * chosen_.size());
    int near_face = -1;
    for (const int64_t index : chosen_) {
      const ClosedSurface::Hit hit = painted_.surface.closest(group.point(index), near_face);
      near_face = hit.face;
      if (hit.distance > config.t_ma + config.margin || hit.distance < -config.t_mi - config.margin) continue;
      write_inputs(hit, &inputs_[as_size(columns) * (evaluated_.size() - first)]);
      evaluated_.push_back(index);
    }
    const std::size_t count = evaluated_.size() - first;
    grow(hidden_, as_size(width) * evaluated_.size());
    float* hidden = hidden_.data() + as_size(width) * first;
    painted_.layers.trunk.run(inputs_.data(), static_cast<int64_t>(count), hidden);
    const Eigen::Map<const Eigen::VectorXf> weights(painted_.layers.density.data(), width);
    for (std::size_t i = 0; i < count; ++i) {
      const float logit = painted_.layers.density_bias +
                          weights.dot(Eigen::Map<const Eigen::VectorXf>(hidden + as_size(width) * i, width));
      density_[evaluated_[first + i]] = static_cast<float>(softplus(logit) / config.density_unit);
    }
  }

  static double softplus(float x) { return x > 20.0f ? x : std::log1p(std::exp(static_cast<double>(x))); }

  static void grow(std::vector<float>& values, std::size_t count) {
    if (values.size() < count) values.resize(count);
  }

  /// The network's inputs for a closest point.
  void write_inputs(const ClosedSurface::Hit& hit, float* row) const {
    const RadianceFieldConfig& config = painted_.config;
    row = interpolate(hit, 0, config.features, row);
    if (config.place_octaves > 0) {
      float position[3];
      interpolate(hit, config.features, 3, position);
      for (int axis = 0; axis < 3; ++axis) encode(position[axis], config.place_octaves, 3, row + axis);
      row += 3 * (1 + 2 * config.place_octaves);
    }
    const double unit = hit.distance < 0 ? config.t_mi : config.t_ma;
    encode(std::clamp(hit.distance / unit, -1.0, 1.0), config.distance_octaves, 1, row);
  }

  /// Writes `count` interpolated vertex values, starting at value `first`. @return end of the written values
  float* interpolate(const ClosedSurface::Hit& hit, int64_t first, int64_t count, float* row) const {
    const int64_t H = painted_.values.size(1);
    const Triangle& face = painted_.surface.faces()[hit.face];
    const float* from = painted_.values.data_ptr<float>() + first;
    const float *a = from + H * face[0], *b = from + H * face[1], *c = from + H * face[2];
    const auto u = static_cast<float>(hit.weights[0]), v = static_cast<float>(hit.weights[1]),
               w = static_cast<float>(hit.weights[2]);
    for (int64_t h = 0; h < count; ++h) row[h] = u * a[h] + v * b[h] + w * c[h];
    return row + count;
  }

  /// The colours of the evaluated samples that the camera sees, summed along the rays. @param out [R,3]
  void add_colours(const RayGroup& group, float* out) {
    std::fill(out, out + 3 * group.rays(), 0.0f);
    const int64_t width = painted_.config.width, columns = painted_.layers.colour.inputs();
    const int64_t encoded = painted_.encoded_direction();
    grow(inputs_, as_size(columns) * evaluated_.size());
    chosen_.clear();
    for (std::size_t i = 0; i < evaluated_.size(); ++i) {
      const int64_t index = evaluated_[i];
      if (weights_[index] <= static_cast<float>(painted_.options.least_weight)) continue;
      float* row = &inputs_[as_size(columns) * chosen_.size()];
      row = std::copy_n(&hidden_[as_size(width) * i], width, row);
      if (encoded > 0) std::copy_n(group.encoded.data_ptr<float>() + encoded * (index / group.samples()), encoded, row);
      chosen_.push_back(index);
    }
    logits_.resize(3 * chosen_.size());
    painted_.layers.colour.run(inputs_.data(), static_cast<int64_t>(chosen_.size()), logits_.data());
    for (std::size_t i = 0; i < chosen_.size(); ++i) {
      const float weight = weights_[chosen_[i]];
      float* pixel = out + 3 * (chosen_[i] / group.samples());
      for (std::size_t c = 0; c < 3; ++c) pixel[c] += weight / (1.0f + std::exp(-logits_[3 * i + c]));
    }
  }

  const Painted& painted_;
  std::vector<int64_t> chosen_;                  ///< samples to evaluate: ray * K + sample
  std::vector<int64_t> evaluated_;               ///< samples within the shell that went through the trunk
  std::vector<float> density_, weights_;         ///< [R*K]
  std::vector<float> inputs_, hidden_, logits_;  ///< rows of samples
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
  const int64_t R = direction.size(0), size = options.rays_at_once;
  const FieldPixels image{torch::empty({R, 3}), torch::empty({R}), torch::empty({R})};
  const Painted painted(field, closest, surface, options);
  const Tensor eye = origin.contiguous(), towards = direction.contiguous();
  std::atomic<int64_t> next{0};
  at::parallel_for(0, at::get_num_threads(), 1, [&](int64_t, int64_t) {
    const torch::NoGradGuard no_grad_in_thread;
    RayPainter painter(painted);
    for (int64_t first = size * next++; first < R; first = size * next++) {
      const auto part = [&](const Tensor& of) { return of.narrow(0, first, std::min(size, R - first)); };
      const RaySamples samples = sample_cells(part(near), part(far), options.samples);
      RayGroup group{eye, part(towards), samples.near.contiguous(), samples.far.contiguous(), samples.t};
      if (painted.encoded_direction() > 0)
        group.encoded = positional_encoding(group.direction, painted.config.direction_octaves);
      painter.draw(group, {part(image.colour), part(image.opacity), part(image.depth)});
    }
  });
  return image;
}

}  // namespace doppel
