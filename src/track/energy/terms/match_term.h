#pragma once

#include <optional>
#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Where a camera sees a vertex of the surface, as its texture says.
struct SurfaceMatch {
  int camera = 0, vertex = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< of the camera's image
  /// How sure the position is, by direction: symmetric, eigenvalues from 0 (unknown, for example along an edge of the
  /// texture) to 1.
  Eigen::Matrix2d sureness = Eigen::Matrix2d::Identity();
};

/// The residual of a match, S (pi_c(v) - u) in reference pixels (image 1024 wide), with the sureness S of the match.
struct MatchResidual {
  Eigen::Vector2d value;
  Eigen::Matrix<double, 2, 3> jacobian;  ///< d value / d position of the vertex
};
/// @param vertex world metres @return nothing for a vertex behind the camera
std::optional<MatchResidual> match_residual(const SurfaceMatch& match, const PinholeCamera& camera,
                                            const Eigen::Vector3d& vertex);

/// Pulls vertices to the pixels where their texture is seen, by match_residual. The term stands for the photometric
/// term of 4.6 in several cameras. A vertex behind a camera has the residual kBehindCamera.
class MatchTerm : public PoseTerm {
 public:
  /// @param cameras [C]; must outlive the term @param weight of each match, per squared reference pixel
  /// @param kernel in reference pixels
  MatchTerm(const std::vector<PinholeCamera>& cameras, std::vector<SurfaceMatch> matches, double weight,
            const RobustKernel& kernel);

  std::string name() const override { return "matches"; }
  void evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Rows& rows) const override;

 private:
  const std::vector<PinholeCamera>& cameras_;
  std::vector<SurfaceMatch> matches_;
  double weight_;
  RobustKernel kernel_;
};

}  // namespace doppel
