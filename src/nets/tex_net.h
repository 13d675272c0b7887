#pragma once

/// TexNet (6.8): from normal maps of the posed template and a camera to the dynamic texture for this camera.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>
#include <string>

#include "doppel/core/options.h"
#include "doppel/nets/motion_window.h"
#include "doppel/nets/unet.h"

namespace doppel {

/// Whether the network's input is the camera's position in the world, or relative to the root of the last frame, like
/// the normals (the motion window of the texture has no translation).
enum class CameraCentre { absolute, root_relative };

struct TexNetConfig {
  int size = 1024;      ///< texels along a side of the network's maps: a power of two
  int past_frames = 2;  ///< F: past frames beside the current one
  int levels = 0;       ///< halvings of the UNet; 0: down to one texel, at most 10
  CameraCentre camera_centre = CameraCentre::absolute;
  /// Adds the output (-1..1) to the static texture instead of mapping the output to colours. Few frames suffice for
  /// training. Not in the thesis.
  bool residual = false;
  /// With `residual`: adds the output to the static texture under the learnt lighting at the texels' normals, so that
  /// the network learns only what distant lighting cannot explain. Not in the thesis.
  bool lit = false;
  /// With `residual`: the texture has this many times the size along each side, a power of two. Output and lighting are
  /// enlarged to it, and the static texture keeps the details that are finer than the network's texels. Not in the
  /// thesis.
  int detail = 1;
  /// The normals of the last frame are those of the finished surface, folds included, instead of the skinned surface.
  bool surface_normals = false;
  UNetConfig unet;

  /// @throws UsageError listing every fault
  void check() const;

  int num_levels() const;
  /// Texels along a side of the texture.
  int texture_size() const { return size * detail; }
  /// Channels of the input: one normal per frame, the camera's centre and direction.
  int num_inputs() const { return 3 * (past_frames + 1) + 6; }
};
void describe_keys(const Keys& keys, TexNetConfig& config);

/// The input of TexNet: channels that differ from texel to texel, and channels that do not.
struct TexNetInput {
  torch::Tensor normals;  ///< [B,3(F+1),T,T] world normals in [-1,1], oldest frame first, 0 outside the charts
  torch::Tensor camera;   ///< [B,6,T,T], the camera's centre and direction; its texels may share memory
};
/// @param normals  [B,3(F+1),T,T], see TexNetInput
/// @param centre [B,3] metres, see texnet_camera_centre; the network's input is a quarter of it
/// @param forward  [B,3] unit vector along the optical axis, world axes
TexNetInput texnet_input(const torch::Tensor& normals, const torch::Tensor& centre, const torch::Tensor& forward);

/// The camera centre in the coordinates that the configuration selects.
/// @param centre [B,3] world metres @param dofs [B,D] of the window's last frame @return [B,3] metres
torch::Tensor texnet_camera_centre(const TexNetConfig& config, const MotionWindow& motion, const torch::Tensor& centre,
                                   const torch::Tensor& dofs);

class TexNetImpl : public torch::nn::Module {
 public:
  /// @param static_texture [T',T',3] RGB 0..1, T' = texture_size(), with `residual` only; saved with the model
  /// @param lighting [3,9] as `shade` takes it, with `lit` only; saved with the model
  /// @param generator draws the initial weights; by default a fresh one with a fixed seed
  explicit TexNetImpl(const TexNetConfig& config, const torch::Tensor& static_texture = {},
                      const torch::Tensor& lighting = {}, std::optional<at::Generator> generator = std::nullopt);

  /// @param generator of the dropout; needed while training unless dropout is 0 @param share the rows of a shared batch
  /// @return [B,T',T',3] RGB 0..1; row 0 is the top (v = 1)
  torch::Tensor forward(const TexNetInput& input, std::optional<at::Generator> generator = std::nullopt,
                        const BatchShare& share = {});

  const TexNetConfig& config() const { return config_; }

 private:
  void check_input(const TexNetInput& input) const;

  TexNetConfig config_;
  UNet unet_{nullptr};
  torch::Tensor static_texture_;  ///< [1,3,T',T'], with residual
  torch::Tensor lighting_;        ///< [3,9], with lit
};
TORCH_MODULE(TexNet);

}  // namespace doppel
