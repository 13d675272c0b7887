#pragma once

#include <vector>

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// The embedded graph deforms as rigidly as possible (6.9): the mean over directed edges (k,l) of
/// u_kl |R(A_k) (g_l - g_k) + g_k + T_k - (g_l + T_l)|^2, in metres, with u_kl the rigidity.
class ArapTerm : public GraphTerm {
 public:
  /// @param weight per squared metre
  ArapTerm(const GraphModel& model, double weight);

  std::string name() const override { return "arap"; }
  void evaluate(const GraphModel& model, const DeformedGraph& graph, bool jacobian,
                BlockResiduals& rows) const override;

 private:
  struct Edge {
    int from, to;
    double rigidity;
  };
  std::vector<Edge> edges_;
  double weight_;
};

}  // namespace doppel
