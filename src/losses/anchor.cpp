#include "doppel/losses/anchor.h"

namespace doppel {

torch::Tensor anchor_loss(const torch::Tensor& vertices, const torch::Tensor& anchors) {
  return (vertices - anchors).square().sum(2).mean();
}

}  // namespace doppel
