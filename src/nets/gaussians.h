#pragma once

/// Gaussians on the surface of an actor, one for each covered texel. They move with the finished mesh.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>

#include "doppel/core/options.h"
#include "doppel/nets/tex_net.h"
#include "doppel/render/lighting/occlusion.h"
#include "doppel/render/splats/splats.h"
#include "doppel/render/splats/surface_frames.h"

namespace doppel {

struct GaussiansConfig {
  int size = 256;        ///< texels along a side: one Gaussian for each covered texel; a power of two
  double spread = 0.7;   ///< initial standard deviation along the surface, in distances of texels
  double opacity = 0.9;  ///< initial
  bool lit = false;      ///< the colours are albedo under the learnt lighting
  bool shadows = false;  ///< with `lit`: limbs shade the body (BodySpheres)
  bool network = true;   ///< a UNet predicts for each pose how the Gaussians change
  int past_frames = 2;   ///< F of the network's input
  int levels = 0;        ///< halvings of the UNet; 0: down to one texel, at most 10
  bool camera = true;    ///< the network sees the camera's position and direction
  bool cull = false;     ///< Gaussians whose texel faces away from a camera are not drawn there
  UNetConfig unet;

  /// The maps that the network sees, in the form of TexNet's.
  TexNetConfig maps() const;
};
void describe_keys(const Keys& keys, GaussiansConfig& config);

/// The texels of the Gaussians, and the surface that they begin with.
struct GaussianTexels {
  TexelPoints points;
  torch::Tensor colours;  ///< float32 [P,3] RGB 0..1
  torch::Tensor spacing;  ///< float32 [P] distance of neighbouring texels on the template, metres
};
/// @param vertices [N,3] of the template, metres @param texture float32 [T,T,3] RGB 0..1, T the size of `space`
GaussianTexels gaussian_texels(const torch::Tensor& vertices, const TextureSpace& space, const torch::Tensor& texture);

/// Offsets, rotations and scales are in the frame of the texel (surface_frames). With the network's prediction p:
///
///   position = x + R (o + 0.03 tanh p_o),  rotation = R q,  log scale = l + p_l,
///   logit of the opacity = a + p_a,  colour = (c + tanh p_c) L(n)
///
/// x, R and n are the position, the rotation and the normal of the texel in this pose. L is the lighting, 1 without
/// `lit`. With `shadows`, L is `shaded_light` with a learnt strength, and the network sees how much light is taken.
class GaussiansImpl : public torch::nn::Module {
 public:
  /// @param lighting [3,9] as `shade` takes it, with `lit` only @param generator draws the network's initial weights
  GaussiansImpl(const GaussiansConfig& config, const GaussianTexels& texels, const torch::Tensor& lighting,
                std::optional<at::Generator> generator = std::nullopt);

  /// @param frames of the texels on the finished surface, [B,P,...]
  /// @param maps the network's input; nothing: the Gaussians that all poses share @param generator, share as in TexNet
  /// @param occlusion with `shadows`: of the texels, [B,P,...]; undefined: nothing is shaded
  Splats forward(const SurfaceFrames& frames, const std::optional<TexNetInput>& maps,
                 const std::optional<at::Generator>& generator = std::nullopt, const BatchShare& share = {},
                 const Occlusion& occlusion = {});

  /// The mean length of the offsets, in distances of texels.
  torch::Tensor offset_length();
  /// The mean over Gaussians and axes of how far the standard deviation exceeds `limit` distances of texels.
  torch::Tensor excess_scale(double limit);

  const GaussiansConfig& config() const { return config_; }
  const TexelPoints& points() const { return points_; }
  /// P, the number of Gaussians.
  int count() const { return static_cast<int>(points_.texel.size(0)); }

 private:
  torch::Tensor changes(const TexNetInput& maps, const std::optional<at::Generator>& generator, const BatchShare& share,
                        const Occlusion& occlusion);
  torch::Tensor map_of(const torch::Tensor& values) const;
  torch::Tensor offsets() const;
  torch::Tensor log_scales() const;

  GaussiansConfig config_;
  TexelPoints points_;
  UNet unet_{nullptr};
  torch::Tensor offset_, rotation_, scale_, opacity_, colour_;  ///< parameters [P,3], [P,4], [P,3], [P], [P,3]
  torch::Tensor first_colour_, spacing_;                        ///< buffers [P,3], [P]
  torch::Tensor lighting_;                                      ///< buffer [3,9], with lit
  torch::Tensor strength_, row_of_texel_;                       ///< parameter [1] and buffer int64 [T*T], with shadows
};
TORCH_MODULE(Gaussians);

}  // namespace doppel
