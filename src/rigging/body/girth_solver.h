#pragma once

#include <span>
#include <vector>

#include "doppel/rigging/body/body_warp.h"
#include "doppel/rigging/body/girths.h"

namespace doppel {

/// Finds the factors with which a warped mesh has given measures. Neighbouring segments blend, so that a girth does not
/// follow its factor alone; a fixed number of corrections on the loops of the reference mesh makes up for that. The
/// factors are smooth functions of the measures.
class GirthSolver {
 public:
  /// @param mesh, weights [N] of the reference @param warp must outlive the solver
  GirthSolver(const TriangleMesh& mesh, const std::vector<SegmentWeights>& weights, const BodyWarp& warp);

  /// The measures of the reference mesh [P].
  const std::vector<double>& reference() const { return reference_; }
  /// @param measures [P] checked
  BodyFactors factors(std::span<const double> measures) const;

 private:
  /// A measure of the mesh and the factor that serves it.
  struct Gauge {
    int measure;
    SurfaceLoop points;         ///< in `vertices_`: a loop, or the two outermost points of one
    Eigen::Vector3d direction;  ///< as in GirthLevel
    Factor factor;
    double exponent;  ///< of the correction
  };

  const BodyWarp& warp_;
  std::vector<double> reference_;
  std::vector<Gauge> gauges_;
  std::vector<Eigen::Vector3d> vertices_;  ///< of the loops, on the reference
  std::vector<SegmentWeights> weights_;    ///< of these vertices
};

}  // namespace doppel
