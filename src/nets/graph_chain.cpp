#include "doppel/nets/graph_chain.h"

#include <ATen/Parallel.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>

#include "doppel/core/error.h"
#include "doppel/layers/graph_convolution/graph_chain_kernel.h"

namespace doppel {

using torch::Tensor;

namespace {

static_assert(GraphChain::kFeatures == kernels::kChainFeatures);

constexpr int64_t kBlocksPerTask = 8;  // about 10 us; less work does not pay for another thread

int64_t chain_blocks(int64_t nodes) { return (nodes + kernels::kChainBlock - 1) / kernels::kChainBlock; }

template <typename Params>
void for_all_blocks(void (*pass)(const Params&, int64_t, int64_t), const Params& p) {
  at::parallel_for(0, chain_blocks(p.nodes), kBlocksPerTask, [&](int64_t begin, int64_t end) { pass(p, begin, end); });
}

const float* floats_or_null(const Tensor& tensor) { return tensor.defined() ? tensor.data_ptr<float>() : nullptr; }

/// The last dimension filled up with zeros.
Tensor widened(const Tensor& tensor) {
  const int64_t missing = GraphChain::kFeatures - tensor.size(-1);
  return missing == 0 ? tensor : at::constant_pad_nd(tensor, {0, missing});
}

/// [K,16,16] as words of two bfloat16, the lower half from the even input. @return int16 [K,8,16,2]
Tensor paired_bfloat16(const Tensor& kernels) {
  return kernels.to(torch::kBFloat16)
      .view(torch::kInt16)
      .view({-1, GraphChain::kFeatures / 2, 2, GraphChain::kFeatures})
      .transpose(2, 3)
      .contiguous();
}

}  // namespace

WeightFormat inference_weights() {
  const char* wish = std::getenv("DOPPEL_WEIGHTS");
  const std::string name = wish ? wish : "float32";
  if (name == "float32") return WeightFormat::float32;
  if (name == "bfloat16") return WeightFormat::bfloat16;
  fail<UsageError>("the environment variable DOPPEL_WEIGHTS is '{}'; float32 (the default) and bfloat16 are allowed",
                   name);
}

GraphChain::GraphChain(const RingWeights& ring, const Layers& layers, WeightFormat format)
    : format_(format),
      nodes_(ring.num_nodes),
      rings_(ring.rings),
      outputs_(layers.last.bias.size(1)),
      order_(ring.order),
      order_index_(ring.order.to(torch::kInt64)),
      positions_(ring.positions.to(torch::kInt64)),
      dense_scale_(layers.dense_scale) {
  const torch::NoGradGuard no_grad;
  add_columns(ring);
  first_kernels_ = placed(layers.first.kernels);
  last_kernels_ = placed(layers.last.kernels.transpose(1, 2));
  last_bias_ = widened(placed(layers.last.bias));
  plan_steps(layers);
}

/// The columns of each row, ring by ring, and ascending in each ring. The weight of a neighbour is (R - hops) times the
/// scale of the row.
void GraphChain::add_columns(const RingWeights& ring) {
  const auto offsets = ring.offsets.accessor<int32_t, 1>(), columns = ring.columns.accessor<int32_t, 1>();
  const auto values = ring.values.accessor<float, 1>();
  std::vector<int32_t> sorted, begins{0};
  scales_ = torch::empty({nodes_});
  for (int64_t position = 0; position < nodes_; ++position) {
    float own = 0.0f;
    for (int32_t e = offsets[position]; e < offsets[position + 1]; ++e)
      if (columns[e] == position) own = values[e];
    const float scale = own / static_cast<float>(rings_);
    for (int64_t count = rings_; count > 0; --count) {
      for (int32_t e = offsets[position]; e < offsets[position + 1]; ++e)
        if (std::lround(values[e] / scale) == count) sorted.push_back(columns[e]);
      begins.push_back(static_cast<int32_t>(sorted.size()));
    }
    scales_[position] = scale;
  }
  begins_ = torch::tensor(at::ArrayRef<int32_t>(begins), torch::kInt32);
  columns_ = torch::tensor(at::ArrayRef<int32_t>(sorted), torch::kInt32);
  if (nodes_ <= std::numeric_limits<uint16_t>::max()) columns_ = columns_.to(torch::kInt16);  // keeps the lower bits
}

Tensor GraphChain::placed(const Tensor& per_node) const {
  return per_node.detach().index_select(0, order_index_).contiguous();
}

Tensor GraphChain::placed_kernels(const Tensor& kernels) const {
  return format_ == WeightFormat::float32 ? placed(kernels) : paired_bfloat16(placed(kernels));
}

GraphChain::Step GraphChain::step_before(const Layer& next) const {
  Step step;
  step.kernels = placed_kernels(next.kernels);
  if (!next.norm.defined()) return step;
  const Tensor scale = next.norm.weight / (next.norm.running_var + next.norm.epsilon).sqrt();
  const Tensor shift = next.norm.bias - next.norm.running_mean * scale;
  step.norm_scale = placed(scale.expand({nodes_, kFeatures}));
  step.norm_shift = placed(shift.expand({nodes_, kFeatures}));
  return step;
}

void GraphChain::plan_steps(const Layers& layers) {
  const std::size_t blocks = layers.units.size() / 2;
  Tensor bias = placed(layers.first.bias);  // of the convolution whose sum comes next
  bool skips = false, after_dense = false;
  const auto add = [&](Step step, bool begins_block) {
    step.bias = bias;
    step.skips = begins_block && skips;
    step.keeps = begins_block;
    step.after_dense = after_dense;
    after_dense = step.is_dense;
    if (begins_block) skips = !step.is_dense;
    steps_.push_back(std::move(step));
  };
  for (std::size_t block = 0; block <= blocks; ++block) {
    if (layers.dense && layers.dense_block == block) {
      Step step = step_before(*layers.dense);
      step.is_dense = true;
      add(std::move(step), true);
      bias = placed(layers.dense->bias);
    }
    if (block == blocks) break;
    for (const std::size_t unit : {2 * block, 2 * block + 1}) {
      add(step_before(layers.units[unit]), unit == 2 * block);
      bias = placed(layers.units[unit].bias);
    }
  }
  add({}, true);
}

/// @param products of the sum @param kept x, replaced if the step keeps its own @param common of the dense sum
/// @return the products for the next sum, or x after the last step
Tensor GraphChain::run_step(const Step& step, const Tensor& products, Tensor& kept, Tensor& common) const {
  kernels::GraphChainStep p;
  p.nodes = nodes_;
  p.rings = rings_;
  p.bias = step.bias.data_ptr<float>();
  if (step.after_dense) {
    p.common = common.data_ptr<float>();
    p.skip = kept.data_ptr<float>();
  } else {
    p.products = products.data_ptr<float>();
    if (columns_.scalar_type() == torch::kInt16)
      p.short_columns = reinterpret_cast<const uint16_t*>(columns_.data_ptr<int16_t>());
    else
      p.columns = columns_.data_ptr<int32_t>();
    p.begins = begins_.data_ptr<int32_t>();
    p.scales = scales_.data_ptr<float>();
    if (step.skips) p.skip = kept.data_ptr<float>();
  }
  const Tensor own = step.keeps ? at::empty({nodes_, kFeatures}, at::kFloat) : Tensor();
  if (step.keeps) p.features = own.data_ptr<float>();
  p.norm_scale = floats_or_null(step.norm_scale);
  p.norm_shift = floats_or_null(step.norm_shift);
  Tensor next;
  if (step.kernels.defined()) {
    p.kernels = step.kernels.data_ptr();
    next = step.is_dense ? at::empty({chain_blocks(nodes_), kFeatures}, at::kFloat)
                         : at::empty({nodes_, kFeatures}, at::kFloat);
    (step.is_dense ? p.sums : p.next) = next.data_ptr<float>();
  }
  for_all_blocks(format_ == WeightFormat::float32 ? kernels::graph_chain_step : kernels::graph_chain_step_short, p);
  if (step.keeps) kept = own;
  if (step.is_dense) common = next.sum(0) * dense_scale_;
  return next;
}

Tensor GraphChain::forward(const Tensor& features) const {
  const torch::NoGradGuard no_grad;
  const Tensor input = features.contiguous();
  kernels::GraphChainEnd first;
  first.nodes = nodes_;
  first.size = input.size(2);
  first.order = order_.data_ptr<int32_t>();
  first.features = input.data_ptr<float>();
  first.kernels = first_kernels_.data_ptr<float>();
  Tensor products = at::empty({nodes_, kFeatures}, at::kFloat), kept, common;
  first.next = products.data_ptr<float>();
  for_all_blocks(kernels::graph_chain_first, first);
  for (const Step& step : steps_) products = run_step(step, products, kept, common);

  kernels::GraphChainEnd last;
  last.nodes = nodes_;
  last.size = outputs_;
  last.features = kept.data_ptr<float>();
  last.kernels = last_kernels_.data_ptr<float>();
  products = at::empty({nodes_, kFeatures}, at::kFloat);
  last.next = products.data_ptr<float>();
  for_all_blocks(kernels::graph_chain_last, last);
  Step end;
  end.bias = last_bias_;
  end.keeps = true;
  run_step(end, products, kept, common);
  return kept.narrow(1, 0, outputs_).index_select(0, positions_).unsqueeze(0);
}

}  // namespace doppel
