#pragma once

#include <string>
#include <vector>

#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Feet that stand neither sink into the floor nor slide. The residual of a landmark p of a sole with the height h
/// above the floor y = 0 when the foot stands, and with its position q in the last frame, is
///   (p_y - h, s (p_x - q_x), s (p_z - q_z)),   metres, s^2 = `slide`,
/// under a robust kernel: a foot that is lifted or that moves has no influence.
class FloorTerm : public PoseTerm {
 public:
  struct Sole {
    int landmark;
    double height;         ///< h, metres
    Eigen::Vector3d last;  ///< q, world metres
  };
  /// @param weight per squared metre @param slide weight of sliding relative to that of the height
  FloorTerm(std::vector<Sole> soles, double weight, double slide, const RobustKernel& kernel);

  std::string name() const override { return "floor"; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Residuals& rows) const override;

 private:
  std::vector<Sole> soles_;
  double weight_;
  Eigen::Vector3d scale_;  ///< of x, y and z
  RobustKernel kernel_;
};

}  // namespace doppel
