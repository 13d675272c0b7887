#pragma once

#include <torch/torch.h>

#include <filesystem>
#include <optional>

#include "doppel/character/character.h"
#include "doppel/layers/surface.h"
#include "doppel/nets/egnet.h"
#include "doppel/train/egnet_config.h"

namespace doppel {

/// EGNet as a run left it: the newest checkpoint, with the weights and statistics meant for use (the running mean of
/// the weights where the run kept one, recalibrated batch norm).
struct TrainedEgNet {
  EgNetRunConfig config;
  Character character;
  EgNet network{nullptr};  ///< in evaluation mode
  CharacterSurface surface{nullptr};
  std::int64_t step = 0;            ///< of the checkpoint
  double frames_per_second = 25.0;  ///< of the capture

  /// @param capture a prepared folder to use instead of the one the run was trained on
  /// @throws Error when the folder is not a run, has no checkpoint, or the character is not the one it was trained for
  static TrainedEgNet load(const std::filesystem::path& run,
                           const std::optional<std::filesystem::path>& capture = std::nullopt);

  /// @param dof_window [B,F+1,D] oldest first @return [B,N,3] world metres, no gradient
  torch::Tensor vertices(const torch::Tensor& dof_window);
};

}  // namespace doppel
