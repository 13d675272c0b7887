#include "doppel/losses/person_images.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr int kBeyond = 2;  // pixels beyond the mask that are compared
constexpr int kEdge = 1;    // pixels on both sides of the edge that may mix

/// A mask with all pixels up to `radius` away, by rows and columns. @param mask [B,C,H,W] 0 or 1
Tensor grown(const Tensor& mask, int radius) {
  return torch::max_pool2d(mask.flatten(0, 1), 2 * radius + 1, 1, radius).view_as(mask);
}

}  // namespace

PersonImages person_over_black(const Tensor& colour, const Tensor& image, const Tensor& mask) {
  return {colour, image * mask.unsqueeze(4), torch::ones_like(mask)};
}

PersonImages person_over_studio(const Tensor& colour, const Tensor& alpha, const Tensor& image, const Tensor& mask,
                                const Tensor& studio) {
  const Tensor near = grown(mask, kBeyond).unsqueeze(4), core = 1.0 - grown(1.0 - mask, kEdge);
  const Tensor over = colour + (1.0 - alpha).unsqueeze(4) * studio;
  return {over * near, image * near, 1.0 - (grown(mask, kEdge) - core)};
}

}  // namespace doppel
