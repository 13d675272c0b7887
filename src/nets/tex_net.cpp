#include "doppel/nets/tex_net.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/render/lighting/sh_lighting.h"
#include "doppel/render/texture/residual_texture.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr int kMinSize = 16, kMaxSize = 4096;
constexpr double kCentreUnit = 4.0;  // metres: scales camera positions to the magnitude of normals
constexpr double kResidualHeadScale = 0.01;

bool is_power_of_two(int number) { return number > 0 && (number & (number - 1)) == 0; }

int log2_of(int power) {
  int exponent = 0;
  while (power > 1) {
    power /= 2;
    ++exponent;
  }
  return exponent;
}

}  // namespace

void describe_keys(const Keys& keys, TexNetConfig& config) {
  bool other_preset = false;
  keys("preset", other_preset, {"paper"}, "no effect; configs/paper/ddc.yaml has the values of the thesis");
  keys("size", config.size, between(kMinSize, kMaxSize), "texels along a side, a power of two");
  keys.require("size", is_power_of_two(config.size), fmt::format("must be a power of two, found {}", config.size));
  keys("past_frames", config.past_frames, between(0, 100), "F, the past frames of the motion window");
  keys("levels", config.levels, between(0, std::min(10, log2_of(config.size))),
       "halvings of the UNet; 0: down to one texel");
  keys("camera_centre", config.camera_centre, {"absolute", "root_relative"},
       "the position of the camera as the network sees it: in the world, or relative to the root");
  keys("residual", config.residual, "add the output to the static texture");
  keys("lit", config.lit, "with `residual`: add it to the static texture under the learnt lighting");
  keys.require("lit", config.residual || !config.lit,
               "needs `residual: true`, because lighting applies to the static texture");
  keys(
      "detail", config.detail, between(1, 16),
      "with `residual`: the texture has this many times the size, a power of two, and keeps details of the static one");
  keys.require("detail", is_power_of_two(config.detail) && (config.residual || config.detail == 1),
               fmt::format("must be a power of two, and 1 without `residual`, found {}", config.detail));
  keys.require("detail", config.texture_size() <= kMaxSize,
               fmt::format("a texture has at most {} texels along a side, found {} times {}", kMaxSize, config.detail,
                           config.size));
  keys("surface_normals", config.surface_normals,
       "the last frame's normals are those of the finished surface instead of the skinned one");
  if (config.residual) config.unet.head_scale = kResidualHeadScale;
  describe_keys(keys, config.unet);
}

int TexNetConfig::num_levels() const { return levels > 0 ? levels : std::min(10, log2_of(size)); }

void TexNetConfig::check() const {
  std::string faults;
  const auto require = [&](bool met, const std::string& fault) {
    if (!met) faults += "\n  " + fault;
  };
  require(is_power_of_two(size) && size >= kMinSize && size <= kMaxSize,
          fmt::format("size must be a power of two between {} and {}, found {}", kMinSize, kMaxSize, size));
  require(past_frames >= 0, fmt::format("past_frames must not be negative, found {}", past_frames));
  require(levels >= 0 && levels <= std::min(10, log2_of(size)),
          fmt::format("levels must lie between 0 (chosen by the size) and {}, found {}", std::min(10, log2_of(size)),
                      levels));
  require(is_power_of_two(detail) && (residual || detail == 1) && texture_size() <= kMaxSize,
          fmt::format("detail must be a power of two, 1 without residual, and size times detail at most {}, found {}",
                      kMaxSize, detail));
  require(residual || !lit, "lit needs residual, because lighting applies to the static texture");
  if (!faults.empty()) fail<UsageError>("the configuration of TexNet cannot be used:{}", faults);
}

TexNetInput texnet_input(const Tensor& normals, const Tensor& centre, const Tensor& forward) {
  check_shape("texnet_input", "normals", normals, {-1, -1, -1, -1}, "[B,3(F+1),T,T]");
  const int64_t B = normals.size(0), T = normals.size(2);
  check_shape("texnet_input", "centre", centre, {B, 3}, "[B,3]");
  check_shape("texnet_input", "forward", forward, {B, 3}, "[B,3]");
  const Tensor camera = at::cat({centre / kCentreUnit, forward}, 1).to(normals.options());
  return {normals, camera.unsqueeze(-1).unsqueeze(-1).expand({-1, -1, T, normals.size(3)})};
}

Tensor texnet_camera_centre(const TexNetConfig& config, const MotionWindow& motion, const Tensor& centre,
                            const Tensor& dofs) {
  check_shape("texnet_camera_centre", "centre", centre, {-1, 3}, "[B,3]");
  if (config.camera_centre == CameraCentre::absolute) return centre;
  return centre - motion.translation(dofs);
}

TexNetImpl::TexNetImpl(const TexNetConfig& config, const Tensor& static_texture, const Tensor& lighting,
                       std::optional<at::Generator> generator)
    : config_(config) {
  config_.check();
  config_.unet.levels = config_.num_levels();
  unet_ = register_module("unet", UNet(config_.num_inputs(), 3, config_.unet, std::move(generator)));
  if (!config_.residual) return;
  check_shape("texnet", "static_texture", static_texture, {config_.texture_size(), config_.texture_size(), 3},
              "[T',T',3]");
  static_texture_ = register_buffer(
      "static_texture", static_texture.detach().to(torch::kFloat32).permute({2, 0, 1}).unsqueeze(0).contiguous());
  if (!config_.lit) return;
  check_shape("texnet", "lighting", lighting, {3, kShBasis}, "[3,9]");
  lighting_ = register_buffer("lighting", lighting.detach().to(torch::kFloat32).clone());
}

void TexNetImpl::check_input(const TexNetInput& input) const {
  const int64_t T = config_.size;
  check_shape("texnet", "input.normals", input.normals, {-1, 3 * (config_.past_frames + 1), T, T}, "[B,3(F+1),T,T]");
  check_shape("texnet", "input.camera", input.camera, {input.normals.size(0), 6, T, T}, "[B,6,T,T]");
}

Tensor TexNetImpl::forward(const TexNetInput& input, std::optional<at::Generator> generator, const BatchShare& share) {
  check_input(input);
  const Tensor raw = unet_->forward({input.normals, input.camera}, std::move(generator), share);
  if (!config_.residual) return ((at::tanh(raw) + 1.0) * 0.5).permute({0, 2, 3, 1}).contiguous();
  const Tensor last = config_.lit ? input.normals.narrow(1, 3 * config_.past_frames, 3) : Tensor();
  if (config_.detail > 1) return detailed_texture(raw, static_texture_, last, lighting_);
  return runs_kernels(*this, raw) ? residual_texture(raw, static_texture_, last, lighting_)
                                  : residual_texture_reference(raw, static_texture_, last, lighting_);
}

}  // namespace doppel
