#pragma once

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Keeps DoFs within the limits of the skeleton (the anatomic term of 4.5.4): the residual is how far a DoF exceeds its
/// limits, in radians (metres) of its joints. Within the limits there is no residual.
class LimitTerm : public PoseTerm {
 public:
  /// @param weight per squared radian of rotations, per squared metre of translations
  explicit LimitTerm(double weight) : weight_(weight) {}

  std::string name() const override { return "limits"; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;

 private:
  double weight_;
};

}  // namespace doppel
