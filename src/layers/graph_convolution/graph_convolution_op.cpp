#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/csrc/jit/frontend/tracer.h>
#include <torch/types.h>

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"
#include "doppel/layers/graph_convolution/graph_convolution_kernel.h"

namespace doppel {

using torch::Tensor;

namespace {

/// All arguments of a call that are not differentiable tensors.
struct ConvolutionSetting {
  std::vector<Tensor> ring;  ///< RingWeights::packed()
  Tensor running_mean, running_var;
  bool elu = false, training = false, node_major = false;
  double momentum = 0.0, epsilon = 0.0;
};

struct ConvolutionSizes {
  int64_t nodes, batch, inputs, outputs;
};

ConvolutionSizes sizes_of(const Tensor& features, const Tensor& kernels, bool node_major) {
  return {features.size(node_major ? 0 : 1), features.size(node_major ? 1 : 0), features.size(2), kernels.size(2)};
}

constexpr const char* kConvolutionOp = "graph_convolution";

void check_arguments(const Tensor& features, const Tensor& kernels, const Tensor& bias, int64_t num_nodes,
                     bool node_major) {
  if (node_major)
    check_shape(kConvolutionOp, "features", features, {num_nodes, -1, -1}, "[K,B,Hin]");
  else
    check_shape(kConvolutionOp, "features", features, {-1, num_nodes, -1}, "[B,K,Hin]");
  check_shape(kConvolutionOp, "kernels", kernels, {num_nodes, features.size(2), -1}, "[K,Hin,Hout]");
  check_shape(kConvolutionOp, "bias", bias, {num_nodes, kernels.size(2)}, "[K,Hout]");
  check_same_kind(kConvolutionOp, "kernels", kernels, features);
  check_same_kind(kConvolutionOp, "bias", bias, features);
}

void check_norm(const NodeNorm& norm, const Tensor& features) {
  if (!norm.defined()) return;
  const int64_t nodes = features.size(0), inputs = features.size(2);
  for (const auto& [name, tensor] : {std::pair{"norm.weight", norm.weight},
                                     {"norm.bias", norm.bias},
                                     {"norm.running_mean", norm.running_mean},
                                     {"norm.running_var", norm.running_var}}) {
    check_shape(kConvolutionOp, name, tensor, {nodes, inputs}, "[K,Hin]");
    check_same_kind(kConvolutionOp, name, tensor, features);
  }
  if (norm.training && features.size(1) == 1)
    fail<UsageError>(
        "batch normalisation per node needs more than one sample while training: with a batch of 1 every normalised "
        "feature is 0; use a larger batch, `norm: channel` or `norm: none`");
}

// ---- binding the kernel ----

template <typename Strided>
Strided strided(const Tensor& tensor, bool node_major) {
  return {tensor.data_ptr<float>(), tensor.stride(node_major ? 1 : 0), tensor.stride(node_major ? 0 : 1)};
}

float* data_or_null(const Tensor& tensor) {
  return tensor.defined() && tensor.numel() > 0 ? tensor.data_ptr<float>() : nullptr;
}

kernels::GraphConvolutionParams make_params(const ConvolutionSizes& n, const ConvolutionSetting& setting) {
  kernels::GraphConvolutionParams p;
  p.nodes = n.nodes;
  p.batch = n.batch;
  p.inputs = n.inputs;
  p.outputs = n.outputs;
  p.order = setting.ring[0].data_ptr<int32_t>();
  p.positions = setting.ring[1].data_ptr<int32_t>();
  p.offsets = setting.ring[2].data_ptr<int32_t>();
  p.columns = setting.ring[3].data_ptr<int32_t>();
  p.values = setting.ring[4].data_ptr<float>();
  p.transposed_values = setting.ring[5].data_ptr<float>();
  p.elu = setting.elu;
  p.batch_statistics = setting.training;
  p.momentum = static_cast<float>(setting.momentum);
  p.epsilon = static_cast<float>(setting.epsilon);
  return p;
}

Tensor packed_workspace(const kernels::GraphConvolutionParams& p) {
  const int64_t width = kernels::graph_convolution_width();
  return at::empty({p.nodes * p.batch * ((p.outputs + width - 1) / width * width)}, at::kFloat);
}

using Pass = void (*)(const kernels::GraphConvolutionParams&, float*, int64_t, int64_t);

/// One parallel region over all nodes. `work` is the multiply-adds of a node, so that tiny calls stay on one thread.
void for_all_nodes(Pass pass, const kernels::GraphConvolutionParams& p, int64_t work) {
  constexpr int64_t kWorkPerTask = 100000;  // about 10 us; less work does not pay for another thread
  const int64_t grain = std::max<int64_t>(1, kWorkPerTask / std::max<int64_t>(1, work));
  const int64_t scratch_size = kernels::graph_convolution_scratch(p);
  at::parallel_for(0, p.nodes, grain, [&](int64_t begin, int64_t end) {
    const Tensor scratch = at::empty({scratch_size}, at::kFloat);
    pass(p, scratch.data_ptr<float>(), begin, end);
  });
}

int64_t kernel_work(const kernels::GraphConvolutionParams& p) { return p.batch * p.inputs * p.outputs; }
int64_t gather_work(const kernels::GraphConvolutionParams& p) {
  return p.batch * p.outputs * (p.offsets[p.nodes] / std::max<int64_t>(1, p.nodes));
}

struct Forward {
  Tensor output, mean, inverse_std;
};

Forward convolution_cpu(const Tensor& features, const Tensor& kernels, const Tensor& bias, const Tensor& skip,
                        const Tensor& norm_weight, const Tensor& norm_bias, const ConvolutionSetting& setting) {
  const ConvolutionSizes n = sizes_of(features, kernels, setting.node_major);
  Forward result;
  result.output = setting.node_major ? at::empty({n.nodes, n.batch, n.outputs}, features.options())
                                     : at::empty({n.batch, n.nodes, n.outputs}, features.options());
  if (norm_weight.defined()) {
    result.mean = at::empty({n.nodes, n.inputs}, features.options());
    result.inverse_std = at::empty({n.nodes, n.inputs}, features.options());
  }
  if (n.batch == 0) return result;

  kernels::GraphConvolutionParams p = make_params(n, setting);
  p.features = strided<kernels::ConstGraphFeatures>(features, setting.node_major);
  p.kernels = kernels.data_ptr<float>();
  p.bias = bias.data_ptr<float>();
  if (skip.defined()) p.skip = strided<kernels::ConstGraphFeatures>(skip, setting.node_major);
  p.norm_weight = data_or_null(norm_weight);
  p.norm_bias = data_or_null(norm_bias);
  p.running_mean = data_or_null(setting.running_mean);
  p.running_var = data_or_null(setting.running_var);
  p.mean = data_or_null(result.mean);
  p.inverse_std = data_or_null(result.inverse_std);
  p.output = strided<kernels::GraphFeatures>(result.output, setting.node_major);
  const Tensor packed = packed_workspace(p);
  p.packed = packed.data_ptr<float>();
  for_all_nodes(kernels::graph_convolution_transform, p, kernel_work(p));
  for_all_nodes(kernels::graph_convolution_gather, p, gather_work(p));
  return result;
}

struct Backward {
  Tensor features, kernels, bias, norm_weight, norm_bias;
};

Backward convolution_backward_cpu(const Tensor& grad_output, const Tensor& features, const Tensor& kernels,
                                  const Tensor& norm_weight, const Tensor& norm_bias, const Tensor& mean,
                                  const Tensor& inverse_std, const ConvolutionSetting& setting, bool features_wanted) {
  const ConvolutionSizes n = sizes_of(features, kernels, setting.node_major);
  Backward result;
  result.kernels = at::empty_like(kernels);
  result.bias = at::empty({n.nodes, n.outputs}, features.options());
  if (features_wanted) result.features = at::empty_like(features);
  if (norm_weight.defined()) {
    result.norm_weight = at::empty_like(norm_weight);
    result.norm_bias = at::empty_like(norm_bias);
  }
  if (n.batch == 0) {
    for (Tensor* gradient : {&result.kernels, &result.bias, &result.norm_weight, &result.norm_bias})
      if (gradient->defined()) gradient->zero_();
    return result;
  }

  kernels::GraphConvolutionParams p = make_params(n, setting);
  p.features = strided<kernels::ConstGraphFeatures>(features, setting.node_major);
  p.kernels = kernels.data_ptr<float>();
  p.norm_weight = data_or_null(norm_weight);
  p.norm_bias = data_or_null(norm_bias);
  p.mean = data_or_null(mean);
  p.inverse_std = data_or_null(inverse_std);
  p.grad_output = strided<kernels::ConstGraphFeatures>(grad_output, setting.node_major);
  p.grad_kernels = result.kernels.data_ptr<float>();
  p.grad_bias = result.bias.data_ptr<float>();
  p.grad_norm_weight = data_or_null(result.norm_weight);
  p.grad_norm_bias = data_or_null(result.norm_bias);
  if (features_wanted) p.grad_features = strided<kernels::GraphFeatures>(result.features, setting.node_major);
  const Tensor packed = packed_workspace(p);
  p.packed = packed.data_ptr<float>();
  for_all_nodes(kernels::graph_convolution_pack, p, p.batch * p.outputs);
  for_all_nodes(kernels::graph_convolution_backward, p, gather_work(p) + 2 * kernel_work(p));
  return result;
}

// ---- autograd ----

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

Tensor absent() { return at::empty({0}, at::kFloat); }
Tensor present(const Tensor& tensor) { return tensor.dim() == 1 ? Tensor() : tensor; }

class GraphConvolutionFunction : public torch::autograd::Function<GraphConvolutionFunction> {
 public:
  static Tensor forward(AutogradContext* context, const Tensor& features, const Tensor& kernels, const Tensor& bias,
                        const Tensor& skip, const Tensor& norm_weight, const Tensor& norm_bias,
                        const ConvolutionSetting& setting) {
    at::AutoDispatchBelowADInplaceOrView below_autograd;
    const Forward result =
        convolution_cpu(features, kernels, bias, present(skip), present(norm_weight), present(norm_bias), setting);
    context->save_for_backward(
        {features, kernels, present(norm_weight), present(norm_bias), result.mean, result.inverse_std});
    context->saved_data["ring"] = setting.ring;
    context->saved_data["elu"] = setting.elu;
    context->saved_data["training"] = setting.training;
    context->saved_data["node_major"] = setting.node_major;
    context->saved_data["features_wanted"] = features.requires_grad();
    context->saved_data["skip"] = skip.requires_grad();
    return result.output;
  }

  static variable_list backward(AutogradContext* context, variable_list grad_outputs) {
    const variable_list saved = context->get_saved_variables();
    ConvolutionSetting setting;
    setting.ring = context->saved_data["ring"].toTensorVector();
    setting.elu = context->saved_data["elu"].toBool();
    setting.training = context->saved_data["training"].toBool();
    setting.node_major = context->saved_data["node_major"].toBool();
    const Tensor grad_output = grad_outputs[0].contiguous();
    const Backward gradient =
        convolution_backward_cpu(grad_output, saved[0], saved[1], saved[2], saved[3], saved[4], saved[5], setting,
                                 context->saved_data["features_wanted"].toBool());
    const Tensor skip = context->saved_data["skip"].toBool() ? grad_output : Tensor();
    return once_differentiable(
        {gradient.features, gradient.kernels, gradient.bias, skip, gradient.norm_weight, gradient.norm_bias, Tensor()},
        kConvolutionOp);
  }
};

// ---- the dense block ----

kernels::GraphConvolutionParams dense_params(const Tensor& features, const Tensor& kernels) {
  kernels::GraphConvolutionParams p;
  p.nodes = features.size(0);
  p.batch = features.size(1);
  p.inputs = features.size(2);
  p.outputs = kernels.size(2);
  p.elu = true;
  p.features = strided<kernels::ConstGraphFeatures>(features, true);
  p.kernels = kernels.data_ptr<float>();
  return p;
}

void for_each_piece(Pass pass, const kernels::GraphConvolutionParams& p, int64_t pieces) {
  const int64_t scratch_size = kernels::graph_convolution_scratch(p);
  at::parallel_for(0, pieces, 1, [&](int64_t begin, int64_t end) {
    const Tensor scratch = at::empty({scratch_size}, at::kFloat);
    pass(p, scratch.data_ptr<float>(), begin, end);
  });
}

/// sum_l elu(f_l) K_l: [K,B,Hin], [K,Hin,Hout] -> [B,Hout].
Tensor dense_sum_cpu(const Tensor& features, const Tensor& kernels) {
  kernels::GraphConvolutionParams p = dense_params(features, kernels);
  const int64_t blocks = (p.nodes + kernels::kGraphDenseBlock - 1) / kernels::kGraphDenseBlock;
  const int64_t width = kernels::graph_convolution_width(), out = (p.outputs + width - 1) / width * width;
  const Tensor sums = at::empty({blocks, p.batch, out}, features.options());
  p.packed = sums.data_ptr<float>();
  for_each_piece(kernels::graph_dense_sum, p, blocks);
  // Added block by block, because at::sum may split its work by the number of threads.
  Tensor total = sums[0].clone();
  for (int64_t block = 1; block < blocks; ++block)
    for (int64_t i = 0; i < p.batch * out; ++i) total.data_ptr<float>()[i] += p.packed[block * p.batch * out + i];
  return total.narrow(1, 0, p.outputs);
}

/// dense_sum_cpu with gradients.
class DenseSumFunction : public torch::autograd::Function<DenseSumFunction> {
 public:
  static Tensor forward(AutogradContext* context, const Tensor& features, const Tensor& kernels) {
    at::AutoDispatchBelowADInplaceOrView below_autograd;
    context->save_for_backward({features, kernels});
    return dense_sum_cpu(features, kernels);
  }

  static variable_list backward(AutogradContext* context, variable_list grad_outputs) {
    const variable_list saved = context->get_saved_variables();
    const Tensor grad_output = grad_outputs[0].contiguous();
    kernels::GraphConvolutionParams p = dense_params(saved[0], saved[1]);
    const Tensor grad_features = at::empty_like(saved[0]), grad_kernels = at::empty_like(saved[1]);
    p.grad_output = {grad_output.data_ptr<float>(), p.outputs, 0};
    p.grad_features = strided<kernels::GraphFeatures>(grad_features, true);
    p.grad_kernels = grad_kernels.data_ptr<float>();
    for_each_piece(kernels::graph_dense_backward, p, p.nodes);
    return once_differentiable({grad_features, grad_kernels}, "elu_dense_broadcast");
  }
};

ConvolutionSetting op_setting(at::TensorList ring, bool node_major) {
  if (ring.size() != 6)
    fail<UsageError>("graph_convolution: ring must hold the 6 tensors of RingWeights::packed(), received {}",
                     ring.size());
  ConvolutionSetting setting;
  setting.ring = ring.vec();
  setting.node_major = node_major;
  return setting;
}

/// @param norm weight, bias, running mean and variance; empty: none
Tensor unit_cpu(const Tensor& features, const Tensor& kernels, const Tensor& bias, at::TensorList ring,
                at::TensorList norm, const OptionalTensor& skip, bool elu, double epsilon, bool node_major) {
  ConvolutionSetting setting = op_setting(ring, node_major);
  check_arguments(features, kernels, bias, ring[0].size(0), node_major);
  if (!norm.empty() && norm.size() != 4)
    fail<UsageError>("graph_convolution_unit: norm must hold 4 tensors or none, received {}", norm.size());
  setting.elu = elu;
  setting.epsilon = epsilon;
  Tensor weight, offset;
  if (!norm.empty()) {
    weight = norm[0].contiguous();
    offset = norm[1].contiguous();
    setting.running_mean = norm[2];
    setting.running_var = norm[3];
  }
  return convolution_cpu(features.contiguous(), kernels.contiguous(), bias.contiguous(),
                         skip ? skip->contiguous() : Tensor(), weight, offset, setting)
      .output;
}

/// The convolution as an op of a trace: for inference, and so without gradients.
Tensor traced_unit(const Tensor& features, const NodeNorm& norm, bool elu, const Tensor& kernels, const Tensor& bias,
                   const RingWeights& ring, const Tensor& skip, bool node_major) {
  static const auto op = find_op<decltype(unit_cpu)>("doppel::graph_convolution_unit");
  std::vector<Tensor> statistics;
  if (norm.defined()) statistics = {norm.weight, norm.bias, norm.running_mean, norm.running_var};
  return op.call(features, kernels, bias, ring.packed(), statistics, optional_of(skip), elu, norm.epsilon, node_major);
}

Tensor dense_sum(const Tensor& features, const Tensor& kernels) {
  if (!torch::jit::tracer::isTracing()) return DenseSumFunction::apply(features, kernels);
  static const auto op = find_op<decltype(dense_sum_cpu)>("doppel::graph_dense_sum");
  return op.call(features, kernels);
}

Tensor run(const Tensor& features, const NodeNorm& norm, bool elu, const Tensor& kernels, const Tensor& bias,
           const RingWeights& ring, const Tensor& skip, bool node_major) {
  if (torch::jit::tracer::isTracing()) return traced_unit(features, norm, elu, kernels, bias, ring, skip, node_major);
  ConvolutionSetting setting;
  setting.ring = ring.packed();
  setting.running_mean = norm.running_mean;
  setting.running_var = norm.running_var;
  setting.elu = elu;
  setting.training = norm.training;
  setting.node_major = node_major;
  setting.momentum = norm.momentum;
  setting.epsilon = norm.epsilon;
  // Autograd does not accept undefined tensors; an empty tensor without gradient means "absent".
  const auto dense = [](const Tensor& tensor) { return tensor.defined() ? tensor.contiguous() : absent(); };
  return GraphConvolutionFunction::apply(dense(features), dense(kernels), dense(bias), dense(skip), dense(norm.weight),
                                         dense(norm.bias), setting);
}

// ---- dispatcher ----

Tensor op_forward(const Tensor& features, const Tensor& kernels, const Tensor& bias, at::TensorList ring,
                  bool node_major) {
  const ConvolutionSetting setting = op_setting(ring, node_major);
  check_arguments(features, kernels, bias, ring[0].size(0), node_major);
  return convolution_cpu(features.contiguous(), kernels.contiguous(), bias.contiguous(), {}, {}, {}, setting).output;
}

Tensor op_forward_autograd(const Tensor& features, const Tensor& kernels, const Tensor& bias, at::TensorList ring,
                           bool node_major) {
  const ConvolutionSetting setting = op_setting(ring, node_major);
  check_arguments(features, kernels, bias, ring[0].size(0), node_major);
  return GraphConvolutionFunction::apply(features.contiguous(), kernels.contiguous(), bias.contiguous(), Tensor(),
                                         Tensor(), Tensor(), setting);
}

std::tuple<Tensor, Tensor, Tensor> op_backward(const Tensor& grad_output, const Tensor& features, const Tensor& kernels,
                                               at::TensorList ring, bool node_major) {
  const Backward gradient =
      convolution_backward_cpu(grad_output.contiguous(), features.contiguous(), kernels.contiguous(), {}, {}, {}, {},
                               op_setting(ring, node_major), true);
  return {gradient.features, gradient.kernels, gradient.bias};
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def("graph_convolution(Tensor features, Tensor kernels, Tensor bias, Tensor[] ring, bool node_major) -> Tensor");
  m.def(
      "graph_convolution_backward(Tensor grad_output, Tensor features, Tensor kernels, Tensor[] ring, bool node_major) "
      "-> (Tensor, Tensor, Tensor)");
  m.def(
      "graph_convolution_unit(Tensor features, Tensor kernels, Tensor bias, Tensor[] ring, Tensor[] norm, "
      "Tensor? skip, bool elu, float epsilon, bool node_major) -> Tensor");
  m.def("graph_dense_sum(Tensor features, Tensor kernels) -> Tensor");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("graph_convolution_unit", unit_cpu);
  m.impl("graph_dense_sum", dense_sum_cpu);
  m.impl("graph_convolution", op_forward);
  m.impl("graph_convolution_backward", op_backward);
}
TORCH_LIBRARY_IMPL(doppel, Autograd, m) { m.impl("graph_convolution", op_forward_autograd); }

}  // namespace

Tensor graph_convolution(const Tensor& features, const Tensor& kernels, const Tensor& bias, const RingWeights& ring) {
  check_arguments(features, kernels, bias, ring.num_nodes, false);
  if (!takes_kernel(features)) return graph_convolution_reference(features, kernels, bias, ring);
  return run(features, {}, false, kernels, bias, ring, {}, false);
}

Tensor graph_convolution_node_major(const Tensor& features, const Tensor& kernels, const Tensor& bias,
                                    const RingWeights& ring) {
  check_arguments(features, kernels, bias, ring.num_nodes, true);
  if (!takes_kernel(features))
    return graph_convolution_reference(features.transpose(0, 1), kernels, bias, ring).transpose(0, 1);
  return run(features, {}, false, kernels, bias, ring, {}, true);
}

Tensor elu_dense_broadcast_node_major(const Tensor& features, const Tensor& kernels, const Tensor& bias, double scale) {
  check_arguments(features, kernels, bias, kernels.size(0), true);
  if (!takes_kernel(features) || features.numel() == 0)
    return features + dense_broadcast(at::elu(features.transpose(0, 1)), kernels, bias, scale).transpose(0, 1);
  const Tensor sum = dense_sum(features.contiguous(), kernels.contiguous());
  return features + (bias.unsqueeze(1) + sum * scale);
}

Tensor elu_graph_convolution_node_major(const Tensor& features, const NodeNorm& norm, const Tensor& kernels,
                                        const Tensor& bias, const RingWeights& ring, const Tensor& skip) {
  check_arguments(features, kernels, bias, ring.num_nodes, true);
  check_norm(norm, features);
  if (skip.defined()) {
    check_shape(kConvolutionOp, "skip", skip, {ring.num_nodes, features.size(1), kernels.size(2)}, "[K,B,Hout]");
    check_same_kind(kConvolutionOp, "skip", skip, features);
  }
  if (takes_kernel(features)) return run(features, norm, true, kernels, bias, ring, skip, true);
  const Tensor active = at::elu(node_norm_reference(features.transpose(0, 1), norm));
  const Tensor output = graph_convolution_reference(active, kernels, bias, ring).transpose(0, 1);
  return skip.defined() ? output + skip : output;
}

}  // namespace doppel
