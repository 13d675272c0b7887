#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <string>
#include <vector>

namespace doppel {

/// The lighting of a capture: nine spherical-harmonics coefficients per colour channel and camera (6.6.1), in the order
/// of render/lighting/sh_lighting.h, channel by channel.
class LightingImpl : public torch::nn::Module {
 public:
  /// @param num_cameras C of the whole dataset; all start with the identity lighting
  /// @param trained indices of the cameras whose coefficients are learnt
  LightingImpl(std::int64_t num_cameras, const std::vector<int>& trained);

  /// Coefficients of cameras. A camera that was not trained, or that is not in the capture, has the mean of the trained
  /// cameras.
  /// @param cameras int64 [B,C'] @return [B,C',3,9]
  torch::Tensor forward(const torch::Tensor& cameras);

  /// The squared distance of the trained cameras from their mean, summed over coefficients, mean over cameras. A camera
  /// cannot observe the light on surfaces that it does not see; a penalty on this distance takes that light from the
  /// other cameras.
  torch::Tensor deviation();

  torch::Tensor mean() const;  ///< of the trained cameras, [1,3,9]

  /// Says which cameras `forward` is asked for, where they are not those of the training.
  /// @param rows of each camera: its row in `coefficients`, or -1 for one that is none of them
  void set_rows(const std::vector<std::int64_t>& rows);

  torch::Tensor coefficients;  ///< parameter [C,3,9]
  torch::Tensor trained;       ///< buffer, bool [C]

 private:
  torch::Tensor rows_;  ///< int64, C for the mean; undefined: the cameras of the training
};
TORCH_MODULE(Lighting);

}  // namespace doppel
