#pragma once

#include <memory>

#include "doppel/detect/networks/output_adapter.h"

namespace doppel {

/// What a network is asked for.
struct Wanted {
  enum class What { person, mask, boxes } what = What::person;
  int points = 0;  ///< of a person; 0: the network finds a mask
};

/// The adapter that `options.output` names, or that of the outputs' shapes:
///
///     points wanted: [1, >= K, h, w] heatmaps; two outputs [1, K, a], [1, K, b] with a : b = W : H SimCC;
///                    [1, n] or [1, K, 2..5] points; [1, 1|2, h, w] and K > 2 a mask
///     mask wanted:   [1, 1|2|N, h, w] or [1, h, w]
///     boxes wanted:  [1, N, 5] or [N, 5] boxes; [1, 1, N, 7] SSD; [1, N, > 5] YOLOX
///
/// @throws Error when no adapter or several adapters fit, or the one that is named is for something else
std::unique_ptr<OutputAdapter> choose_adapter(const NetworkOptions& options, const Wanted& wanted,
                                              const std::vector<NetworkOutput>& outputs, cv::Size input);

}  // namespace doppel
