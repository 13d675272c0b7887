#include "doppel/nets/gaussians.h"

#include <cmath>

#include "doppel/core/tensor/checks.h"
#include "doppel/render/lighting/sh_lighting.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr int kChanges = 10;         // offset 3, log scale 3, opacity 1, colour 3
constexpr double kMaxOffset = 0.03;  // metres, that the network predicts
constexpr double kHeadScale = 0.01;
constexpr double kThickness = 0.3;  // first standard deviation along the normal, of that along the surface

// A step of Adam changes every parameter by about the learning rate. These factors give each kind of parameter a step
// of its own; they are about those of the published 3DGS code at a learning rate of 1e-3.
constexpr double kOffsetStep = 0.15, kRotationStep = 1.0, kScaleStep = 5.0, kOpacityStep = 30.0, kColourStep = 1.0,
                 kStrengthStep = 5.0;

}  // namespace

void describe_keys(const Keys& keys, GaussiansConfig& config) {
  keys("size", config.size, between(16, 1024),
       "texels along a side, one Gaussian for each covered one: a power of two");
  keys.require("size", (config.size & (config.size - 1)) == 0,
               fmt::format("must be a power of two, found {}", config.size));
  keys("spread", config.spread, between(0.1, 10.0), "initial standard deviation along the surface, in texels");
  keys("opacity", config.opacity, between(0.01, 0.99), "initial");
  keys("lit", config.lit, "the colours are albedo under the learnt lighting");
  keys("shadows", config.shadows, "with `lit`: limbs shade the body");
  keys.require("shadows", config.lit || !config.shadows,
               "found true; only light that was learnt is shaded, so set lit: true");
  keys("network", config.network, "a UNet predicts for each pose how the Gaussians change");
  keys("past_frames", config.past_frames, between(0, 100), "F, the past frames of the network's motion window");
  keys("levels", config.levels, between(0, 10), "halvings of the UNet; 0: down to one texel");
  keys.require("levels", (1 << config.levels) <= config.size,
               fmt::format("{} halvings of {} texels are too many", config.levels, config.size));
  keys("camera", config.camera, "the network sees the camera's position, relative to the root, and direction");
  keys("cull", config.cull, "Gaussians whose texel faces away from the camera are not drawn");
  config.unet.head_scale = kHeadScale;
  describe_keys(keys, config.unet);
}

TexNetConfig GaussiansConfig::maps() const {
  TexNetConfig maps;
  maps.size = size;
  maps.past_frames = past_frames;
  maps.levels = levels;
  maps.camera_centre = CameraCentre::root_relative;
  maps.surface_normals = true;
  return maps;
}

GaussianTexels gaussian_texels(const Tensor& vertices, const TextureSpace& space, const Tensor& texture) {
  GaussianTexels out;
  out.points = space.points();
  // Neighbours of a texel lie one texel away in the map: the mean distance to those on the right and below.
  const Tensor positions = space.positions(vertices.to(torch::kFloat32).unsqueeze(0))[0], inside = space.mask();
  const auto distance = [&](int axis) {
    const std::int64_t n = space.size() - 1;
    const Tensor step = (positions.narrow(axis + 1, 1, n) - positions.narrow(axis + 1, 0, n)).norm(2, 0);
    const Tensor both = inside.narrow(axis, 1, n) & inside.narrow(axis, 0, n);
    Tensor padded = torch::full({space.size(), space.size()}, std::nan(""));
    padded.narrow(axis, 0, n).copy_(torch::where(both, step, torch::full_like(step, std::nan(""))));
    return padded;
  };
  const Tensor across = torch::stack({distance(0), distance(1)}).nanmean(0).flatten().index_select(0, out.points.texel);
  const double typical = across.nanmedian().item<double>();
  // Texels without neighbours, and jumps between charts.
  out.spacing = across.nan_to_num(typical).clamp(0.2 * typical, 3.0 * typical);
  out.colours = texture.flatten(0, 1).index_select(0, out.points.texel);
  return out;
}

GaussiansImpl::GaussiansImpl(const GaussiansConfig& config, const GaussianTexels& texels, const Tensor& lighting,
                             std::optional<at::Generator> generator)
    : config_(config), points_(texels.points) {
  const std::int64_t P = points_.texel.size(0);
  check_floats("gaussians", "colours", texels.colours, {P, 3}, "[P,3]");
  check_floats("gaussians", "spacing", texels.spacing, {P}, "[P]");
  first_colour_ = register_buffer("first_colour", texels.colours.clone());
  spacing_ = register_buffer("spacing", texels.spacing.clone());
  offset_ = register_parameter("offset", torch::zeros({P, 3}));
  rotation_ = register_parameter("rotation", torch::zeros({P, 4}));
  scale_ = register_parameter("scale", torch::zeros({P, 3}));
  opacity_ = register_parameter("opacity", torch::zeros({P}));
  colour_ = register_parameter("colour", torch::zeros({P, 3}));
  if (config_.lit) {
    check_shape("gaussians", "lighting", lighting, {3, kShBasis}, "[3,9]");
    lighting_ = register_buffer("lighting", lighting.detach().to(torch::kFloat32).clone());
  }
  if (config_.shadows) {
    strength_ = register_parameter("strength", torch::zeros({1}));
    Tensor rows = torch::full({static_cast<std::int64_t>(config_.size) * config_.size}, P, torch::kInt64);
    rows.index_copy_(0, points_.texel, torch::arange(P));
    row_of_texel_ = register_buffer("row_of_texel", rows);
  }
  if (!config_.network) return;
  config_.unet.levels = config_.maps().num_levels();
  unet_ = register_module("unet", UNet(config_.maps().num_inputs() + (config_.shadows ? 1 : 0), kChanges, config_.unet,
                                       std::move(generator)));
}

Tensor GaussiansImpl::offsets() const { return kOffsetStep * offset_; }

Tensor GaussiansImpl::log_scales() const {
  const Tensor axes = torch::tensor({1.0, 1.0, kThickness}, torch::kFloat32);
  return (config_.spread * spacing_.unsqueeze(1) * axes).log() + kScaleStep * scale_;
}

Tensor GaussiansImpl::map_of(const Tensor& values) const {
  const Tensor padded = torch::constant_pad_nd(values, {0, 1});
  return padded.index_select(1, row_of_texel_).unflatten(1, {config_.size, config_.size}).unsqueeze(1);
}

Tensor GaussiansImpl::changes(const TexNetInput& maps, const std::optional<at::Generator>& generator,
                              const BatchShare& share, const Occlusion& occlusion) {
  const Tensor camera = config_.camera ? maps.camera : torch::zeros_like(maps.camera);
  Tensor surface = maps.normals;
  if (config_.shadows) {
    const Tensor taken = occlusion.amount.defined() ? occlusion.amount : torch::zeros({surface.size(0), count()});
    surface = torch::cat({surface, map_of(taken)}, 1);
  }
  const Tensor raw = unet_->forward({surface, camera}, generator, share);
  return raw.flatten(2).index_select(2, points_.texel).transpose(1, 2);  // [B,P,10]
}

Splats GaussiansImpl::forward(const SurfaceFrames& frames, const std::optional<TexNetInput>& maps,
                              const std::optional<at::Generator>& generator, const BatchShare& share,
                              const Occlusion& occlusion) {
  Tensor offset = offsets().unsqueeze(0), scale = log_scales().unsqueeze(0),
         opacity = std::log(config_.opacity / (1.0 - config_.opacity)) + kOpacityStep * opacity_.unsqueeze(0),
         colour = first_colour_.unsqueeze(0) + kColourStep * colour_.unsqueeze(0);
  if (unet_ && maps) {
    const Tensor change = changes(*maps, generator, share, occlusion);
    offset = offset + kMaxOffset * change.narrow(2, 0, 3).tanh();
    scale = scale + change.narrow(2, 3, 3);
    opacity = opacity + change.select(2, 6);
    colour = colour + change.narrow(2, 7, 3).tanh();
  }
  if (config_.shadows && occlusion.amount.defined())
    colour = colour * shaded_light(frames.normals, occlusion, lighting_, 1.0 + kStrengthStep * strength_);
  else if (lighting_.defined())
    colour = colour * sh_basis(frames.normals).matmul(lighting_.t());
  const Tensor own = kRotationStep * rotation_ + torch::tensor({1.0, 0.0, 0.0, 0.0}, torch::kFloat32);
  Splats out;
  out.positions = frames.positions + turned(frames.rotations, offset);
  out.rotations = quaternion_product(frames.rotations, own.unsqueeze(0));
  out.log_scales = scale.expand_as(frames.positions);
  out.opacities = opacity.expand_as(frames.positions.select(2, 0));
  out.harmonics = ((colour.expand_as(frames.positions) - 0.5) / kFirstHarmonic).unsqueeze(2);
  if (config_.cull) out.normals = frames.normals;
  return out;
}

Tensor GaussiansImpl::offset_length() { return ((offsets().square().sum(1) + 1e-12).sqrt() / spacing_).mean(); }

Tensor GaussiansImpl::excess_scale(double limit) {
  return (log_scales().exp() / spacing_.unsqueeze(1) - limit).clamp_min(0.0).mean();
}

}  // namespace doppel
