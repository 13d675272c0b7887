#pragma once

#include <string>

#include "doppel/track/pose_model.h"
#include "doppel/track/solver/residuals.h"

namespace doppel {

/// One part of the energy of a pose. A term fills in the rows of its residuals and their slopes; weights, robust
/// kernels and sums are `Residuals`' affair.
class PoseTerm {
 public:
  virtual ~PoseTerm() = default;
  virtual std::string name() const = 0;
  /// Called before every step, at the pose that it starts from: chooses what stays constant during the step.
  virtual void freeze(const PoseModel&, const PosedBody&) {}
  /// @param slopes whether the rows carry slopes; then `body` was posed with them
  virtual void evaluate(const PoseModel& model, const PosedBody& body, bool slopes, Residuals& rows) const = 0;
};

}  // namespace doppel
