#include "doppel/track/energy/terms/arap_term.h"

#include "doppel/character/rigidity.h"
#include "doppel/core/as_size.h"

namespace doppel {

ArapTerm::ArapTerm(const GraphModel& model, double weight) : weight_(weight) {
  const Character& character = model.character();
  const std::vector<double> rigidity = node_rigidity(character.rigidity, character.graph);
  for (const auto& [k, l] : character.graph.edges) {
    const double u = 0.5 * (rigidity[k] + rigidity[l]);
    edges_.push_back({k, l, u});
    edges_.push_back({l, k, u});
  }
}

void ArapTerm::evaluate(const GraphModel& model, const DeformedGraph& graph, bool jacobian,
                        BlockResiduals& rows) const {
  rows.reset(model.num_unknowns(), 3, {}, jacobian);
  for (const Edge& edge : edges_) {
    const auto k = as_size(edge.from), l = as_size(edge.to);
    const Eigen::Index first = rows.add_group(weight_ * edge.rigidity / static_cast<double>(edges_.size()));
    const Eigen::Vector3d rest = model.nodes()[l] - model.nodes()[k];
    const Eigen::Vector3d error = graph.rotation[k] * rest + graph.position[k] - graph.position[l];
    for (int i = 0; i < 3; ++i) {
      rows.value(first + i) = error[i];
      if (!jacobian) continue;
      model.add_node_jacobian(graph, edge.from, 1.0, rest, Eigen::Vector3d::Unit(i), rows.jacobian(first + i));
      rows.jacobian(first + i).block(edge.to)[3 + i] -= 1.0;
    }
  }
}

}  // namespace doppel
