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

void LightingImpl::set_rows(const std::vector<std::int64_t>& rows) {
  rows_ = torch::empty({static_cast<std::int64_t>(rows.size())}, torch::kInt64);
  for (std::size_t c = 0; c < rows.size(); ++c)
    rows_[static_cast<std::int64_t>(c)] = rows[c] < 0 ? trained.size(0) : rows[c];
}

torch::Tensor LightingImpl::forward(const torch::Tensor& cameras) {
  const torch::Tensor middle = mean();
  const torch::Tensor all = torch::cat({torch::where(trained.view({-1, 1, 1}), coefficients, middle), middle});
  torch::Tensor index = cameras.reshape({-1});
  if (rows_.defined())
    index = torch::cat({rows_, torch::full({1}, trained.size(0), torch::kInt64)})
                .index_select(0, index.clamp_max(rows_.size(0)));
  return all.index_select(0, index.clamp_max(trained.size(0))).view({cameras.size(0), cameras.size(1), 3, 9});
}

}  // namespace doppel
