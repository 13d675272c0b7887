#pragma once

#include <Eigen/Core>
#include <string>

#include "doppel/solver/point_system.h"

namespace doppel {

/// Vertices as columns, [3,N] world metres.
using SurfacePoints = Eigen::Ref<const Eigen::Matrix3Xd>;

/// One term of the energy of a surface whose vertices are all unknown (4.7). A term computes the residuals of one
/// vertex or edge at a time; `SurfaceProblem` sums and solves. Several threads call `rows` at once, so it must not
/// change the term.
class SurfaceTerm {
 public:
  /// The unknowns of the rows: one vertex, or the difference of the two ends of an edge of the mesh.
  enum class Element { vertex, edge };

  virtual ~SurfaceTerm() = default;
  virtual std::string name() const = 0;
  virtual Element element() const = 0;
  /// Called before every step, at the vertices that the step starts from. Chooses what stays constant during the step.
  virtual void freeze(const SurfacePoints&) {}
  /// @param element a vertex, or an edge in the order of `MeshTopology::edges`
  virtual PointRows rows(int element, const SurfacePoints& vertices) const = 0;
};

}  // namespace doppel
