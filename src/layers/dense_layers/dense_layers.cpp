#include "doppel/layers/dense_layers/dense_layers.h"

#include <ATen/Parallel.h>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/layers/dense_layers/dense_layers_kernel.h"
#include "doppel/layers/op_support.h"

namespace doppel {

using torch::Tensor;

DenseLayers::DenseLayers(const std::vector<std::pair<Tensor, Tensor>>& layers) {
  const torch::NoGradGuard no_grad;
  if (layers.empty()) fail<UsageError>("dense layers: there must be at least one");
  const int64_t panel = kernels::dense_panel();
  for (const auto& [weight, bias] : layers) {
    check_shape("dense layers", "weight", weight, {-1, layers_.empty() ? -1 : layers_.back().outputs}, "[out,in]");
    check_shape("dense layers", "bias", bias, {weight.size(0)}, "[out]");
    const int64_t outputs = weight.size(0), inputs = weight.size(1), panels = (outputs + panel - 1) / panel;
    const int64_t unused = panels * panel - outputs;
    const Tensor rows = at::constant_pad_nd(weight.to(torch::kFloat32), {0, 0, 0, unused});
    layers_.push_back({inputs, outputs, rows.view({panels, panel, inputs}).transpose(1, 2).contiguous(),
                       at::constant_pad_nd(bias.to(torch::kFloat32), {0, unused}).contiguous()});
  }
}

Tensor DenseLayers::forward(const Tensor& points_in) const {
  check_shape("dense layers", "points", points_in, {-1, layers_.front().inputs}, "[P,in]");
  if (points_in.scalar_type() != torch::kFloat32 || !points_in.device().is_cpu())
    fail<UsageError>("dense layers: points must be float32 on the CPU, found {}", describe(points_in));
  const Tensor points = points_in.contiguous();
  const Tensor out = at::empty({points.size(0), layers_.back().outputs}, points.options());
  std::vector<DenseLayerParams> params;
  for (const Layer& layer : layers_)
    params.push_back({layer.inputs, layer.outputs, layer.weight.size(0), layer.weight.data_ptr<float>(),
                      layer.bias.data_ptr<float>()});
  const int count = static_cast<int>(params.size());
  constexpr int64_t kPointsPerTask = 192;
  at::parallel_for(0, points.size(0), kPointsPerTask, [&](int64_t begin, int64_t end) {
    std::vector<float> scratch(as_size(kernels::dense_layers_scratch(params.data(), count)));
    kernels::dense_layers(params.data(), count, points.data_ptr<float>(), begin, end, out.data_ptr<float>(),
                          scratch.data());
  });
  return out;
}

}  // namespace doppel
