#pragma once

#include <torch/torch.h>

#include "doppel/character/skeleton.h"
#include "doppel/core/config.h"

namespace doppel {

/// Noise on the angles that a network sees, in radians. A few hundred frames show few poses; this keeps a network from
/// learning them by heart.
struct PoseNoiseOptions {
  double pose = 0.0;   ///< one draw for all frames of the window: other poses, the same velocities
  double input = 0.0;  ///< one draw for each frame: other velocities

  /// Keys `pose_noise` and `input_noise` of a section `data`.
  static PoseNoiseOptions read(const ConfigReader& data);
};

class PoseNoise {
 public:
  PoseNoise(const Skeleton& skeleton, const PoseNoiseOptions& options);

  /// @param dof_window [B,F+1,D]; translations stay as they are @return the same shape
  torch::Tensor apply(const torch::Tensor& dof_window, at::Generator generator) const;

 private:
  PoseNoiseOptions options_;
  torch::Tensor radians_to_dof_;  ///< [D]; 0 for DoFs that turn nothing
};

}  // namespace doppel
