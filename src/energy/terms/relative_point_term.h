#pragma once

#include <vector>

#include "doppel/energy/terms/point_term.h"

namespace doppel {

/// Landmarks lie to each other as given points do (4.4): p_m - (q_m + t'), in metres, with the shift t' that fits best.
/// As t' stands in no other term it need not be an unknown: it is the weighted mean of p_m - q_m, so that the rows are
/// differences from the means of both sides and no shift of the points changes anything.
class RelativePointTerm : public PoseTerm {
 public:
  RelativePointTerm(std::string name, std::vector<PointTerm::Target> targets, double weight);

  std::string name() const override { return name_; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;

 private:
  std::string name_;
  std::vector<PointTerm::Target> targets_;
  double weight_, sum_ = 0.0;  ///< of the targets' weights
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
};

}  // namespace doppel
