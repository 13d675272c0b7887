#pragma once

#include <string>
#include <vector>

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Keeps nodes near given parameters: those of the last frame (temporal term), or zero. The energy is the mean over
/// nodes of the squared difference, in metres. A radian counts as the mean length of an edge.
class NodeTerm : public GraphTerm {
 public:
  /// @param centre [6K] @param weight per squared metre
  NodeTerm(std::string name, const GraphModel& model, std::vector<double> centre, double weight);

  std::string name() const override { return name_; }
  void evaluate(const GraphModel& model, const DeformedGraph& graph, bool jacobian,
                BlockResiduals& rows) const override;

 private:
  std::string name_;
  std::vector<double> centre_;
  double weight_, metres_per_radian_;
};

}  // namespace doppel
