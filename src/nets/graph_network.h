#pragma once

/// The interface of the graph network inside EGNet and DeltaNet: from features per node to outputs per node.

#include <torch/nn/module.h>
#include <torch/types.h>

#include <string>
#include <vector>

namespace doppel {

/// `sagcn` is the method (6.5.3). The others are the baselines of Table 6.4: a fully connected network on the motion
/// itself, and the same architecture with Chebyshev graph convolutions that share their weights among all nodes.
enum class NetworkKind { sagcn, fully_connected, chebyshev };

/// The values of the configuration key, in the order of the enumerators.
inline const std::vector<std::string>& network_kind_words() {
  static const std::vector<std::string> words{"sagcn", "fully_connected", "chebyshev"};
  return words;
}

class GraphNetwork : public torch::nn::Module {
 public:
  /// @param features [B,K,Hin], or [B,1,Hin] for a network that takes the motion as one vector @return [B,K,Hout]
  virtual torch::Tensor forward(const torch::Tensor& features) = 0;
};

}  // namespace doppel
