#include "doppel/render/lighting/sh_lighting.h"

#include <cmath>

namespace doppel {

using torch::Tensor;
using torch::indexing::Ellipsis;

Tensor sh_basis(const Tensor& normals) {
  const Tensor x = normals.index({Ellipsis, 0}), y = normals.index({Ellipsis, 1}), z = normals.index({Ellipsis, 2});
  return torch::stack({torch::ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y}, -1);
}

Tensor sh_constants() {
  const double band0 = 0.5 * std::sqrt(1 / M_PI), band1 = std::sqrt(3 / (4 * M_PI)), mixed = 0.5 * std::sqrt(15 / M_PI);
  const double zz = 0.25 * std::sqrt(5 / M_PI), xx_yy = 0.25 * std::sqrt(15 / M_PI);
  return torch::tensor({band0, band1, band1, band1, mixed, mixed, zz, mixed, xx_yy}, torch::kFloat64);
}

Tensor identity_lighting() {
  Tensor lighting = torch::zeros({3, kShBasis});
  lighting.index_put_({torch::indexing::Slice(), 0}, 1);
  return lighting;
}

}  // namespace doppel
