#include "doppel/nets/plain_field.h"

#include "doppel/core/tensor/checks.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr uint64_t kPlainFieldSeed = 1;
constexpr int64_t kRaysAtOnce = 128;

/// The networks of the guided field, with an encoded position as input.
RadianceFieldConfig network_of(const PlainFieldConfig& config) {
  RadianceFieldConfig network = config.field;
  network.features = 3 * (1 + 2 * config.position_octaves);
  network.distance_octaves = 0;
  network.place_octaves = 0;
  return network;
}

}  // namespace

void describe_keys(const Keys& keys, PlainFieldConfig& config) {
  describe_field_layers(keys.section("field"), config.field);
  keys("field.skip", config.field.skip, between(0, 31),
       "layer of the trunk, from 1, after which the encoded position is an input again; 0: none");
  keys.require("field.skip", config.field.skip < config.field.layers,
               fmt::format("found {}; it must be less than `layers`, {}", config.field.skip, config.field.layers));
  keys("position_octaves", config.position_octaves, between(0, 20), "encoding of the position");
  keys("coarse", config.coarse, between<std::int64_t>(1, 4096), "samples of the coarse network");
  keys("fine", config.fine, between<std::int64_t>(1, 4096), "further samples of the fine network");
}

PlainFieldImpl::PlainFieldImpl(const Tensor& vertices, const PlainFieldConfig& config,
                               std::optional<at::Generator> generator)
    : config_(config) {
  check_shape("plain field", "vertices", vertices, {-1, 3}, "[N,3]");
  at::Generator draw = generator ? *generator : at::detail::createCPUGenerator(kPlainFieldSeed);
  const Tensor low = vertices.amin(0), high = vertices.amax(0);
  centre_ = register_buffer("centre", (0.5 * (low + high)).to(torch::kFloat32));
  half_size_ = register_buffer("half_size", (0.5 * (high - low) + config.margin).to(torch::kFloat32));
  coarse_ = register_module("coarse", RadianceField(network_of(config), draw));
  fine_ = register_module("fine", RadianceField(network_of(config), draw));
}

FieldValues PlainFieldImpl::at(RadianceField& network, const Tensor& points, const Tensor& direction) {
  const Tensor position = positional_encoding((points - centre_) / half_size_, config_.position_octaves);
  return network->forward(position, torch::zeros({points.size(0)}), direction);
}

RenderedRays PlainFieldImpl::seen(RadianceField& network, const Tensor& origin, const Tensor& direction,
                                  const RaySamples& samples) {
  const int64_t R = samples.t.size(0), K = samples.t.size(1);
  const Tensor looks = direction.unsqueeze(1).expand({R, K, 3}).reshape({R * K, 3});
  const FieldValues values = at(network, samples.points(origin, direction).reshape({R * K, 3}), looks);
  return render_volume(values.density.view({R, K}), values.colour.view({R, K, 3}), samples);
}

RayInterval PlainFieldImpl::through_box(const Tensor& origin, const Tensor& direction) const {
  // The intersections of the ray with the pairs of planes. A component of 0 gives infinities, which the minimum and
  // maximum handle correctly.
  const Tensor a = (centre_ - half_size_ - origin) / direction, b = (centre_ + half_size_ - origin) / direction;
  const Tensor enters = torch::min(a, b).amax(1).clamp_min(0), leaves = torch::max(a, b).amin(1);
  const Tensor hit = leaves > enters, nowhere = torch::zeros_like(enters);
  return {torch::where(hit, enters, nowhere), torch::where(hit, leaves, nowhere)};
}

PlainRays PlainFieldImpl::render(const Tensor& origin, const Tensor& direction,
                                 const std::optional<at::Generator>& generator, const BatchShare& share) {
  check_shape("plain field", "direction", direction, {-1, 3}, "[R,3]");
  const auto [near, far] = through_box(origin, direction);
  PlainRays rays;
  rays.coarse_samples = sample_cells(near, far, config_.coarse, generator, share);
  rays.coarse = seen(coarse_, origin, direction, rays.coarse_samples);
  rays.fine_samples =
      sample_by_weight(rays.coarse_samples, rays.coarse.weights.detach(), config_.fine, generator, share);
  rays.fine = seen(fine_, origin, direction, rays.fine_samples);
  return rays;
}

FieldImage PlainFieldImpl::draw(const Tensor& projection, int64_t height, int64_t width) {
  const torch::NoGradGuard no_grad;
  const Tensor all = torch::arange(height * width, torch::kInt64);
  const PixelRays rays =
      pixel_rays(projection, torch::stack({all.remainder(width), torch::div(all, width, "floor")}, 1));
  const RayInterval box = through_box(rays.origin, rays.direction);
  const Tensor positions = (box.far > box.near).nonzero().squeeze(1);
  const Tensor colour = torch::zeros({height * width, 3}), opacity = torch::zeros({height * width}),
               depth = torch::zeros({height * width});
  for (const Tensor& part : positions.split(kRaysAtOnce)) {
    const RenderedRays drawn = render(rays.origin, rays.direction.index_select(0, part)).fine;
    colour.index_copy_(0, part, drawn.colour);
    opacity.index_copy_(0, part, drawn.opacity);
    depth.index_copy_(0, part, drawn.depth);
  }
  return {colour.view({height, width, 3}), opacity.view({height, width}), depth.view({height, width})};
}

}  // namespace doppel
