#include "doppel/nets/radiance_field.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr uint64_t kRadianceFieldSeed = 1;

/// He's bound for layers followed by a ReLU.
torch::nn::Linear make_linear(int64_t inputs, int64_t outputs, bool bias, at::Generator& generator) {
  torch::nn::Linear layer(torch::nn::LinearOptions(inputs, outputs).bias(bias));
  const torch::NoGradGuard no_grad;
  const double bound = std::sqrt(6.0 / static_cast<double>(inputs));
  layer->weight.uniform_(-bound, bound, generator);
  if (bias) layer->bias.zero_();
  return layer;
}

int64_t encoded(int64_t channels, int octaves) { return channels * (1 + 2 * octaves); }

}  // namespace

void describe_field_layers(const Keys& keys, RadianceFieldConfig& config) {
  keys("layers", config.layers, between(1, 32), "of the trunk");
  keys("width", config.width, between(1, 8192), "of the trunk");
  keys("view_width", config.view_width, between(1, 8192), "of the branch with the direction of view");
  keys("view_dependent", config.view_dependent,
       "false: colours do not depend on the direction of view; for few cameras");
}

void describe_keys(const Keys& keys, RadianceFieldConfig& config) {
  keys("features", config.features, between(1, 4096), "of the motion, per vertex");
  describe_field_layers(keys, config);
  keys("place_octaves", config.place_octaves, between(0, 20),
       "encoding of the closest point on the rest surface; 0: not an input, as in the thesis");
  keys("t_mi", config.t_mi, between(1e-6, 1e3), "metres inside the mesh that are sampled");
  keys("t_ma", config.t_ma, between(1e-6, 1e3), "metres outside the mesh that are sampled");
}

void RadianceFieldConfig::check() const {
  std::string faults;
  const auto require = [&](bool met, const std::string& fault) {
    if (!met) faults += "\n  " + fault;
  };
  require(features > 0, fmt::format("features must be at least 1, found {}", features));
  require(layers > 0, fmt::format("layers must be at least 1, found {}", layers));
  require(skip >= 0 && skip < std::max(layers, 1),
          fmt::format("skip must be 0, or a layer of the trunk before the last of {}, found {}", layers, skip));
  require(width > 0 && view_width > 0,
          fmt::format("width and view_width must be at least 1, found {} and {}", width, view_width));
  require(distance_octaves >= 0 && direction_octaves >= 0 && place_octaves >= 0,
          fmt::format("octaves must not be negative, found {} of distance, {} of direction and {} of the rest position",
                      distance_octaves, direction_octaves, place_octaves));
  require(density_unit > 0, fmt::format("density_unit must be greater than 0 m, found {}", density_unit));
  require(t_mi > 0 && t_ma > 0, fmt::format("t_mi and t_ma must be greater than 0 m, found {} and {}", t_mi, t_ma));
  require(margin >= 0, fmt::format("margin must not be negative, found {}", margin));
  if (!faults.empty()) fail<UsageError>("the configuration of the radiance field cannot be used:{}", faults);
}

Tensor positional_encoding(const Tensor& x, int octaves) {
  std::vector<Tensor> parts{x};
  for (int k = 0; k < octaves; ++k) {
    const Tensor angle = x * std::ldexp(M_PI, k);
    parts.push_back(angle.sin());
    parts.push_back(angle.cos());
  }
  return torch::cat(parts, -1);
}

RadianceFieldImpl::RadianceFieldImpl(const RadianceFieldConfig& config, std::optional<at::Generator> generator)
    : config_(config) {
  config_.check();
  at::Generator draw = generator ? *generator : at::detail::createCPUGenerator(kRadianceFieldSeed);
  trunk_ = register_module("trunk", torch::nn::ModuleList());
  for (int i = 0; i < config_.layers; ++i) trunk_->push_back(make_linear(layer_inputs(i), config_.width, true, draw));
  density_ = register_module("density", make_linear(config_.width, 1, true, draw));
  view_of_hidden_ = register_module("view_of_hidden", make_linear(config_.width, config_.view_width, true, draw));
  if (config_.view_dependent)
    view_of_direction_ = register_module(
        "view_of_direction", make_linear(encoded(3, config_.direction_octaves), config_.view_width, false, draw));
  colour_ = register_module("colour", make_linear(config_.view_width, 3, true, draw));
}

int64_t RadianceFieldImpl::num_inputs() const {
  const int64_t position = config_.place_octaves > 0 ? encoded(3, config_.place_octaves) : 0;
  return config_.features + position + encoded(1, config_.distance_octaves);
}

int64_t RadianceFieldImpl::layer_inputs(int layer) const {
  if (layer == 0) return num_inputs();
  return config_.width + (layer == config_.skip ? num_inputs() : 0);
}

RadianceFieldImpl::ImageLayers RadianceFieldImpl::image_layers() const {
  if (config_.skip > 0) fail("a radiance field with `skip` {} has no image layers; draw it by `forward`", config_.skip);
  const torch::NoGradGuard no_grad;
  std::vector<std::pair<Tensor, Tensor>> trunk;
  for (const auto& module : *trunk_) {
    const auto* layer = module->as<torch::nn::Linear>();
    trunk.emplace_back(layer->weight, layer->bias);
  }
  Tensor view = view_of_hidden_->weight;
  if (view_of_direction_) view = torch::cat({view, view_of_direction_->weight}, 1);
  const Tensor density = density_->weight.to(torch::kFloat32).contiguous();
  const float* weights = density.data_ptr<float>();
  return {DenseLayers(trunk), std::vector<float>(weights, weights + density.numel()), density_->bias.item<float>(),
          DenseLayers({{view, view_of_hidden_->bias}, {colour_->weight, colour_->bias}}, LastLayer::linear)};
}

Tensor RadianceFieldImpl::density(const Tensor& hidden) {
  return torch::softplus(density_->forward(hidden).squeeze(-1)) / config_.density_unit;
}

Tensor RadianceFieldImpl::colour(const Tensor& hidden, const Tensor& direction) {
  Tensor view = view_of_hidden_->forward(hidden);
  if (view_of_direction_)
    view = view + view_of_direction_->forward(positional_encoding(direction, config_.direction_octaves));
  return colour_->forward(view.relu_()).sigmoid();
}

FieldValues RadianceFieldImpl::forward(const Tensor& values, const Tensor& distance, const Tensor& direction) {
  check_shape("radiance field", "values", values, {-1, config_.vertex_values()}, "[P,H]");
  check_shape("radiance field", "distance", distance, {values.size(0)}, "[P]");
  check_shape("radiance field", "direction", direction, {values.size(0), 3}, "[P,3]");
  std::vector<Tensor> inputs{values.narrow(1, 0, config_.features)};
  if (config_.place_octaves > 0)
    inputs.push_back(positional_encoding(values.narrow(1, config_.features, 3), config_.place_octaves));
  inputs.push_back(positional_encoding(distance.unsqueeze(1), config_.distance_octaves));
  const Tensor input = torch::cat(inputs, 1);
  Tensor hidden = input;
  for (int i = 0; i < config_.layers; ++i) {
    if (i > 0 && i == config_.skip) hidden = torch::cat({input, hidden}, 1);
    hidden = trunk_->at<torch::nn::LinearImpl>(static_cast<std::size_t>(i)).forward(hidden).relu_();
  }
  return {density(hidden), colour(hidden, direction)};
}

RenderedRays render_field(RadianceField& field, const ClosestPoint& closest, const FieldSurface& surface,
                          const Tensor& origin, const Tensor& direction, const RaySamples& samples) {
  const RadianceFieldConfig& config = field->config();
  const int64_t R = samples.t.size(0), K = samples.t.size(1);
  const Tensor points = samples.points(origin, direction).reshape({1, R * K, 3});
  const ClosestPoints at = closest->forward(surface.vertices.unsqueeze(0), points);
  const Tensor distance = at.distance.squeeze(0);
  // Only points near the mesh go through the network: elsewhere the density is 0.
  const Tensor rows =
      ((distance <= config.t_ma + config.margin) & (distance >= -config.t_mi - config.margin)).nonzero().squeeze(1);
  const Tensor carried = closest->interpolate(at, surface.values.unsqueeze(0)).squeeze(0).index_select(0, rows);
  const Tensor looks = direction.index_select(0, torch::div(rows, K, "floor"));
  const FieldValues values =
      field->forward(carried, normalised_distance(distance.index_select(0, rows), config.t_mi, config.t_ma), looks);
  const auto spread = [&](const Tensor& of) {
    std::vector<int64_t> shape = of.sizes().vec();
    shape[0] = R * K;
    return torch::zeros(shape, of.options()).index_copy(0, rows, of);
  };
  return render_volume(spread(values.density).view({R, K}), spread(values.colour).view({R, K, 3}), samples);
}

}  // namespace doppel
