#pragma once

#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/terms/silhouette_term.h"
#include "doppel/track/surface/part_mask.h"
#include "doppel/track/surface/surface_term.h"

namespace doppel {

/// Pulls the outline of the surface to the outline of the mask (4.10): the residual of an outline vertex is the
/// distance of its projection from the mask's outline less `OutlineVertex::distance`, in reference pixels (image 1024
/// wide). As in `SilhouetteTerm`, a vertex that faces away from the nearest outline is pulled to the opposite one (b =
/// -1). A vertex projected onto another part of the body has no residual (b = 0).
class OutlineTerm : public SurfaceTerm {
 public:
  struct Evidence {
    const PinholeCamera& camera;
    const OutlineField& field;                    ///< not empty
    const PartMask& parts;                        ///< of the posed surface; an empty one allows everything
    const std::vector<char>& vertex_part;         ///< [N]
    const std::vector<Eigen::Vector3d>& normals;  ///< [N] of the posed surface, unit
  };
  /// @param evidence its referents must outlive the term
  /// @param outline vertices on the outline of the surface, each once; their `camera` is ignored
  /// @param weight of each vertex, per squared reference pixel
  /// @param scale of the Geman-McClure kernel, reference pixels (0: no kernel); its weights stay constant during a step
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
  std::vector<double> targets_;  ///< [N] distance for which the residual is 0, reference pixels
};

}  // namespace doppel
