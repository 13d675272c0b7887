#include "doppel/layers/skinning/skinning.h"

#include "doppel/core/error.h"

namespace doppel {

SkinningWeights node_skinning_weights(const Character& character) {
  SkinningWeights nodes;
  nodes.bones = character.skin.bones;
  const IndexRows& rows = character.skin.vertex_bones;
  for (int vertex : character.graph.node_vertex) {
    if (vertex < 0 || vertex >= rows.num_rows()) {
      fail("a graph node is at vertex {}, the skin has {} vertices", vertex, rows.num_rows());
    }
    for (int e = rows.offsets[vertex]; e < rows.offsets[vertex + 1]; ++e) {
      nodes.vertex_bones.items.push_back(rows.items[e]);
      nodes.weights.push_back(character.skin.weights[e]);
    }
    nodes.vertex_bones.offsets.push_back(static_cast<int>(nodes.vertex_bones.items.size()));
  }
  return nodes;
}

SkinningImpl::SkinningImpl(const SkinningWeights& weights, SkinningMode mode)
    : torch::nn::Module("Skinning"),
      weights_(weights.vertex_bones, weights.weights, weights.num_bones(), "skinning weights"),
      mode_(mode) {}

torch::Tensor SkinningImpl::forward(const torch::Tensor& points, const torch::Tensor& bones) const {
  return skinning(points, bones, weights_, mode_);
}

torch::Tensor SkinningImpl::blend(const torch::Tensor& bones) const { return skinning_blend(bones, weights_, mode_); }

void SkinningImpl::pretty_print(std::ostream& stream) const {
  stream << "Skinning(" << (mode_ == SkinningMode::linear ? "linear" : "dual_quaternion")
         << ", points=" << weights_.num_rows << ", bones=" << weights_.num_columns
         << ", influences=" << weights_.items.size(0) << ")";
}

}  // namespace doppel
