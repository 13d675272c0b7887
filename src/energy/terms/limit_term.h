#pragma once

#include "doppel/energy/terms/term.h"

namespace doppel {

/// Joints bend as far as the skeleton says (the anatomic term of 4.5.4): how far a DoF lies beyond its limits, in
/// radians (metres) of its joints. Within the limits there is no row.
class LimitTerm : public PoseTerm {
 public:
  explicit LimitTerm(double weight) : weight_(weight) {}

  std::string name() const override { return "limits"; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;

 private:
  double weight_;
};

}  // namespace doppel
