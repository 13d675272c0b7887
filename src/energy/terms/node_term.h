#pragma once

#include <string>
#include <vector>

#include "doppel/energy/terms/term.h"

namespace doppel {

/// Nodes stay near given parameters: those of the last frame (the temporal term), or none at all. The mean over nodes
/// of the squared difference, metres; a radian counts as much as it moves the ends of the edges there are.
class NodeTerm : public GraphTerm {
 public:
  /// @param centre [6K]
  NodeTerm(std::string name, const GraphModel& model, std::vector<double> centre, double weight);

  std::string name() const override { return name_; }
  void evaluate(const GraphModel& model, const DeformedGraph& graph, bool jacobian, BlockResiduals& rows) const override;

 private:
  std::string name_;
  std::vector<double> centre_;
  double weight_, metres_per_radian_;
};

}  // namespace doppel
