#pragma once

#include <string>
#include <vector>

#include "doppel/energy/terms/term.h"

namespace doppel {

/// DoFs stay near a given pose unless something speaks for another value: their difference from it, in radians (metres)
/// of their joints. The root is free: its translations and its turn have no row.
class PriorTerm : public PoseTerm {
 public:
  /// @param centre [D]
  PriorTerm(std::string name, std::vector<double> centre, double weight);
  /// @param weights [D] of each DoF
  PriorTerm(std::string name, std::vector<double> centre, std::vector<double> weights);

  std::string name() const override { return name_; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;

 private:
  std::string name_;
  std::vector<double> centre_;
  std::vector<double> weights_;
};

}  // namespace doppel
