#pragma once

#include <vector>

#include "doppel/track/surface/surface_term.h"

namespace doppel {

/// Keeps the lengths of edges in the template (4.13): the residual is |V_i - V_j| - |V^_i - V^_j|, metres. Cloth bends
/// more easily than it stretches.
class LengthTerm : public SurfaceTerm {
 public:
  /// @param edges, edge_weights, rest_lengths (metres) of the mesh; all must outlive the term
  /// @param weight per squared metre
  LengthTerm(const std::vector<Link>& edges, const std::vector<double>& edge_weights,
             const std::vector<double>& rest_lengths, double weight);

  std::string name() const override { return "length"; }
  Element element() const override { return Element::edge; }
  /// An edge of length 0 has a residual but no jacobian.
  PointRows rows(int edge, const SurfacePoints& vertices) const override;

 private:
  const std::vector<Link>& edges_;
  const std::vector<double>& edge_weights_;
  const std::vector<double>& rest_lengths_;
  double weight_;
};

}  // namespace doppel
