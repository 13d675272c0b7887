#pragma once

#include <vector>

#include "doppel/track/energy/terms/point_term.h"

namespace doppel {

/// Pulls landmarks to given points up to a common translation (4.4): the residual is p_m - (q_m + t'), in metres, with
/// the best translation t'. As t' occurs in no other term, it need not be an unknown: it is the weighted mean of
/// p_m - q_m. The residuals therefore compare differences from the two means, and a translation of all points changes
/// nothing.
class RelativePointTerm : public PoseTerm {
 public:
  /// @param weight per squared metre, times that of the target
  RelativePointTerm(std::string name, std::vector<PointTerm::Target> targets, double weight);

  std::string name() const override { return name_; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;

 private:
  std::string name_;
  std::vector<PointTerm::Target> targets_;
  double weight_, sum_ = 0.0;  ///< the sum of the targets' weights
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
};

}  // namespace doppel
