#pragma once

#include <optional>
#include <string>
#include <vector>

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Pulls landmarks to given positions in the world: the residual is p_m - q_m, in metres. With the positions of the
/// last frame this is the temporal term (4.6). With triangulated positions it initialises a fit far from the solution.
class PointTerm : public PoseTerm {
 public:
  struct Target {
    int landmark = 0;
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    double weight = 1.0;
  };
  /// @param weight per squared metre, times that of the target @param kernel in metres
  PointTerm(std::string name, std::vector<Target> targets, double weight, const RobustKernel& kernel = {});

  std::string name() const override { return name_; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;

 private:
  std::string name_;
  std::vector<Target> targets_;
  double weight_;
  RobustKernel kernel_;
};

}  // namespace doppel
