#pragma once

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Keeps the parameters of a shape near those of people: the residual is (s_p - mean_p) / deviation_p.
class ShapePriorTerm : public ShapeTerm {
 public:
  /// @param weight per squared deviation
  explicit ShapePriorTerm(double weight) : weight_(weight) {}

  std::string name() const override { return "shape prior"; }
  void evaluate(const ShapeModel& model, const PosedShape& shape, bool jacobian, Residuals& rows) const override;

 private:
  double weight_;
};

}  // namespace doppel
