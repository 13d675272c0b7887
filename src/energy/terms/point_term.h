#pragma once

#include <optional>
#include <string>
#include <vector>

#include "doppel/energy/terms/term.h"

namespace doppel {

/// Landmarks belong at given points of the world: p_m - q_m, in metres. With points of the last frame this is the
/// temporal term (4.6), with triangulated ones it leads a first fit from afar.
class PointTerm : public PoseTerm {
 public:
  struct Target {
    int landmark = 0;
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    double weight = 1.0;
  };
  /// @param kernel in metres
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
