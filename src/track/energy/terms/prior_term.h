#pragma once

#include <string>
#include <vector>

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Pulls DoFs to a given pose: the residual is their difference from it, in radians (metres) of their joints. The root
/// is free: its translation and rotation have no residual.
class PriorTerm : public PoseTerm {
 public:
  /// @param centre [D] @param weight per squared radian of rotations, per squared metre of translations
  PriorTerm(std::string name, std::vector<double> centre, double weight);
  /// @param weights [D] of each DoF, in the same units
  PriorTerm(std::string name, std::vector<double> centre, std::vector<double> weights);

  std::string name() const override { return name_; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;

 private:
  std::string name_;
  std::vector<double> centre_;
  std::vector<double> weights_;
};

}  // namespace doppel
