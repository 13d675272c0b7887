#include "doppel/layers/dense_layers/dense_layers.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {

using torch::Tensor;

DenseLayers::DenseLayers(const std::vector<std::pair<Tensor, Tensor>>& layers, LastLayer last) {
  const torch::NoGradGuard no_grad;
  if (layers.empty()) fail<UsageError>("dense layers: there must be at least one");
  const int64_t panel = kernels::dense_panel();
  for (const auto& [weight, bias] : layers) {
    check_shape("dense layers", "weight", weight, {-1, layers_.empty() ? -1 : outputs()}, "[out,in]");
    check_shape("dense layers", "bias", bias, {weight.size(0)}, "[out]");
    const int64_t out = weight.size(0), in = weight.size(1), panels = (out + panel - 1) / panel;
    const int64_t unused = panels * panel - out;
    const Tensor rows = at::constant_pad_nd(weight.to(torch::kFloat32), {0, 0, 0, unused});
    packed_.push_back({rows.view({panels, panel, in}).transpose(1, 2).contiguous(),
                       at::constant_pad_nd(bias.to(torch::kFloat32), {0, unused}).contiguous()});
    layers_.push_back(
        {in, out, panels, packed_.back().weight.data_ptr<float>(), packed_.back().bias.data_ptr<float>(), true});
  }
  layers_.back().rectified = last == LastLayer::rectified;
}

void DenseLayers::run(const float* points, int64_t count, float* out) const {
  const int layers = static_cast<int>(layers_.size());
  thread_local std::vector<float> scratch;
  scratch.resize(std::max(scratch.size(), as_size(kernels::dense_layers_scratch(layers_.data(), layers))));
  kernels::dense_layers(layers_.data(), layers, points, count, out, scratch.data());
}

}  // namespace doppel
