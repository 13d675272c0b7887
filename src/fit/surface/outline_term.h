#pragma once

#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/energy/evidence.h"
#include "doppel/fit/surface/part_mask.h"
#include "doppel/fit/surface/surface_term.h"
#include "doppel/energy/terms/silhouette_term.h"

namespace doppel {

/// The outline of the surface belongs on the outline of the mask (4.10): the distance of the projection of each outline
/// vertex to it, in pixels of an image 1024 wide. As in the pose's `SilhouetteTerm`, a vertex that faces away from the
/// nearest outline is sent to the opposite one (b = -1). A vertex that has wandered onto another part of the body says
/// nothing (b = 0), and one far from the outline little.
class OutlineTerm : public SurfaceTerm {
 public:
  struct Evidence {
    const Camera& camera;                         ///< without distortion
    const OutlineField& field;                    ///< not empty
    const PartMask& parts;                        ///< of the posed surface; an empty one disables nothing
    const std::vector<char>& vertex_part;         ///< [N]
    const std::vector<Eigen::Vector3d>& normals;  ///< [N] of the posed surface, unit
  };
  /// @param evidence what it refers to must outlive the term
  /// @param outline vertices on the outline of the surface, each once; their `camera` is not looked at
  /// @param scale of the Geman-McClure kernel, reference pixels; its weights are frozen for each step
  OutlineTerm(const Evidence& evidence, std::vector<OutlineVertex> outline, double weight, double scale);

  std::string name() const override { return "silhouette"; }
  Element element() const override { return Element::vertex; }
  void freeze(const SurfacePoints& vertices) override;
  PointRows rows(int vertex, const SurfacePoints& vertices) const override;

 private:
  Evidence evidence_;
  std::vector<OutlineVertex> outline_;
  double weight_, scale_;
  std::vector<double> weights_;  ///< [N] 0 for those without rows
  std::vector<double> targets_;  ///< [N] distance that the row is measured from, reference pixels
};

}  // namespace doppel
