#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include "doppel/character/skeleton.h"
#include "doppel/core/options.h"
#include "doppel/distributed/batch_share.h"

namespace doppel {

/// Gaussian noise on the input angles of a network, radians. A few hundred frames show few poses; noise keeps a network
/// from overfitting to them.
struct PoseNoiseOptions {
  double pose = 0.0;   ///< standard deviation of noise common to a motion window: changes poses, not velocities
  double input = 0.0;  ///< standard deviation of noise of each frame: changes velocities too
};
/// The keys in a section `data`.
void describe_keys(const Keys& keys, PoseNoiseOptions& options);

class PoseNoise {
 public:
  PoseNoise(const Skeleton& skeleton, const PoseNoiseOptions& options);

  /// Noise for the input of a network in training mode. In evaluation mode the window stays as it is, and no random
  /// number is drawn.
  /// @param dof_window [B,F+1,D]; translations stay as they are @param share the rows of a batch that ranks
  /// share @return the same shape
  torch::Tensor apply(const torch::Tensor& dof_window, const torch::nn::Module& network, const at::Generator& generator,
                      const BatchShare& share = {}) const;

 private:
  PoseNoiseOptions options_;
  torch::Tensor radians_to_dof_;  ///< [D]; 0 for DoFs that rotate no joint
};

}  // namespace doppel
