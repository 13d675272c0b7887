#include "doppel/track/energy/terms/node_term.h"

#include <algorithm>

#include "doppel/core/as_size.h"

namespace doppel {

NodeTerm::NodeTerm(std::string name, const GraphModel& model, std::vector<double> centre, double weight)
    : name_(std::move(name)), centre_(std::move(centre)), weight_(weight / model.num_nodes()), metres_per_radian_(0.0) {
  const auto& edges = model.character().graph.edges;
  for (const auto& [k, l] : edges) metres_per_radian_ += (model.nodes()[k] - model.nodes()[l]).norm();
  metres_per_radian_ /= static_cast<double>(std::max<std::size_t>(1, edges.size()));
}

void NodeTerm::evaluate(const GraphModel& model, const DeformedGraph& graph, bool jacobian,
                        BlockResiduals& rows) const {
  rows.reset(model.num_unknowns(), kBlockSize, {}, jacobian);
  for (int k = 0; k < model.num_nodes(); ++k) {
    const Eigen::Index first = rows.add_group(weight_);
    for (int i = 0; i < kBlockSize; ++i) {
      const auto u = as_size(kBlockSize * k + i);
      const double scale = i < 3 ? metres_per_radian_ : 1.0;
      rows.value(first + i) = scale * (graph.parameters[u] - centre_[u]);
      if (jacobian) rows.jacobian(first + i).block(k)[i] = scale;
    }
  }
}

}  // namespace doppel
