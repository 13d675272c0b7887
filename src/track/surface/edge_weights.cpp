#include "doppel/track/surface/edge_weights.h"

namespace doppel {

std::vector<double> edge_weights(const MeshTopology& topology, const std::vector<double>& rigidity) {
  std::vector<double> weights;
  for (const auto& [a, b] : topology.edges()) {
    const double stiffness = 0.5 * (rigidity[a] + rigidity[b]);
    weights.push_back(stiffness / topology.one_ring().size(a) + stiffness / topology.one_ring().size(b));
  }
  return weights;
}

}  // namespace doppel
