#include "doppel/nets/lighting.h"

#include "doppel/render/lighting/sh_lighting.h"

namespace doppel {

LightingImpl::LightingImpl(std::int64_t num_cameras, const std::vector<int>& trained_cameras) {
  coefficients = register_parameter("coefficients", identity_lighting().expand({num_cameras, 3, 9}).contiguous());
  trained = torch::zeros({num_cameras}, torch::kBool);
  for (int camera : trained_cameras) trained[camera] = true;
  trained = register_buffer("trained", trained);
}

torch::Tensor LightingImpl::mean() const {
  const torch::Tensor weight = trained.to(coefficients.scalar_type()).view({-1, 1, 1});
  return (coefficients * weight).sum(0, true) / weight.sum().clamp_min(1.0);
}

torch::Tensor LightingImpl::deviation() {
  const torch::Tensor weight = trained.to(coefficients.scalar_type()).view({-1, 1, 1});
  return ((coefficients - mean()).square() * weight).sum() / weight.sum().clamp_min(1.0);
}

torch::Tensor LightingImpl::forward(const torch::Tensor& cameras) {
  const torch::Tensor middle = mean();
  const torch::Tensor all = torch::cat({torch::where(trained.view({-1, 1, 1}), coefficients, middle), middle});
  return all.index_select(0, cameras.reshape({-1}).clamp_max(trained.size(0)))
      .view({cameras.size(0), cameras.size(1), 3, 9});
}

}  // namespace doppel
