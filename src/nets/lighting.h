#pragma once

#include <torch/torch.h>

#include <string>
#include <vector>

namespace doppel {

/// The lighting of a capture: nine spherical-harmonics coefficients per colour channel and camera (6.6.1), in the order
/// of render/sh_lighting.h, channel by channel.
class LightingImpl : public torch::nn::Module {
 public:
  /// @param num_cameras C of the whole dataset; all begin with the identity lighting
  /// @param trained indices of the cameras whose coefficients are learnt
  LightingImpl(std::int64_t num_cameras, const std::vector<int>& trained);

  /// Coefficients of cameras; one that was not learnt, or that the capture did not have, has the mean of those
  /// that were.
  /// @param cameras int64 [B,C'] @return [B,C',3,9]
  torch::Tensor forward(const torch::Tensor& cameras);

  /// How far the learnt cameras are from their mean: squared, summed over coefficients, mean over cameras. A camera
  /// says nothing about light from behind what it sees; held to the mean, it takes that from the others.
  torch::Tensor deviation();

  torch::Tensor mean() const;  ///< of the learnt cameras, [1,3,9]

  torch::Tensor coefficients;  ///< parameter [C,3,9]
  torch::Tensor trained;       ///< buffer, bool [C]
};
TORCH_MODULE(Lighting);

}  // namespace doppel
