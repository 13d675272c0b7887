#include "doppel/layers/graph_convolution/graph_convolution.h"

namespace doppel {

using torch::Tensor;

GraphConvolutionImpl::GraphConvolutionImpl(RingWeights ring, int inputs, int outputs)
    : ring_(std::move(ring)), inputs_(inputs), outputs_(outputs) {
  reset();
}

void GraphConvolutionImpl::reset() {
  kernels = register_parameter("kernels", torch::zeros({ring_.num_nodes, inputs_, outputs_}));
  bias = register_parameter("bias", torch::zeros({ring_.num_nodes, outputs_}));
}

Tensor GraphConvolutionImpl::forward(const Tensor& features) {
  return graph_convolution(features, kernels, bias, ring_);
}

Tensor GraphConvolutionImpl::forward_node_major(const Tensor& features) {
  return graph_convolution_node_major(features, kernels, bias, ring_);
}

Tensor GraphConvolutionImpl::forward_reference(const Tensor& features) {
  return graph_convolution_reference(features, kernels, bias, ring_);
}

}  // namespace doppel
