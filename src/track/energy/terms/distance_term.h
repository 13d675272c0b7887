#pragma once

#include <array>
#include <vector>

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Gives pairs of landmarks the distances that they have on the person: the residual is |p_a - p_b| - d, metres.
class DistanceTerm : public ShapeTerm {
 public:
  struct Pair {
    std::array<int, 2> landmarks;
    double distance = 0.0;  ///< metres
    double weight = 1.0;
  };
  /// @param weight per squared metre, times that of the pair
  DistanceTerm(std::vector<Pair> pairs, double weight) : pairs_(std::move(pairs)), weight_(weight) {}

  std::string name() const override { return "distances"; }
  void evaluate(const ShapeModel& model, const PosedShape& shape, bool jacobian, Residuals& rows) const override;

 private:
  std::vector<Pair> pairs_;
  double weight_;
};

}  // namespace doppel
