#pragma once

#include <optional>
#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// A vertex on the outline of the posed surface, as one camera sees it.
struct OutlineVertex {
  int camera = 0, vertex = 0;
  /// Signed distance to the outline of the surface, reference pixels (image 1024 wide), - inside. As the mesh is not
  /// dense, most outline vertices lie a little inside the surface's outline. They should lie as far inside the mask.
  double distance = 0.0;
};

/// Sets the vertices' own distances to 0: the thesis wants every vertex on the outline of the mask (4.5, 4.10).
inline void drop_own_distances(std::vector<OutlineVertex>& outline) {
  for (OutlineVertex& vertex : outline) vertex.distance = 0.0;
}

/// Pulls the outline of the surface to the outline of the mask (4.5): the residual of an outline vertex is the distance
/// of its projection from the mask's outline less `OutlineVertex::distance`, in reference pixels (image 1024 wide). The
/// vertices of a camera share `weight` equally, so that a finer mesh does not count more.
///
/// A vertex inside the mask whose normal points away from the nearest outline belongs to the opposite outline (b = -1
/// in the thesis). The thesis keeps the residual |d| and negates its jacobian. The term uses the equivalent residual
/// d - 2 d0, with d0 the distance at the start of the step. Its cost falls along the step, so that a damped solver can
/// recognise a good step.
template <typename Model>
class SilhouetteTerm : public Term<Model> {
 public:
  /// @param cameras, frame [C]; both must outlive the term
  /// @param weight of each camera, per squared reference pixel @param inside factor of the weight inside the mask
  /// @param kernel in reference pixels
  SilhouetteTerm(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
                 std::vector<OutlineVertex> vertices, double weight, double inside, const RobustKernel& kernel);

  std::string name() const override { return "silhouette"; }
  void freeze(const Model& model, const typename Model::State& body) override;
  void evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                typename Model::Rows& rows) const override;
  void linearise(const Model& model, const typename Model::State& body, typename Model::Rows& rows) override;

 private:
  /// A vertex, its projection, and the distance field there. @pre has_field(i)
  struct Seen {
    typename Model::SkinnedVertex vertex;
    std::optional<ProjectedPoint> projected;
    OutlineField::Sample sample;  ///< if projected
  };
  bool has_field(std::size_t i) const;
  Seen see(const Model& model, const typename Model::State& body, std::size_t i) const;
  void choose_side(const Model& model, const Seen& seen, std::size_t i);
  void add_row(const Model& model, const typename Model::State& body, const Seen& seen, std::size_t i, bool jacobian,
               typename Model::Rows& rows) const;

  const std::vector<PinholeCamera>& cameras_;
  const FrameEvidence& frame_;
  std::vector<OutlineVertex> vertices_;
  std::vector<double> weights_;  ///< [vertices]
  std::vector<double> targets_;  ///< [vertices] distance for which the residual is 0, reference pixels
  double inside_;                ///< factor of a residual inside the mask
  RobustKernel kernel_;
};

/// Whether the nearest outline of the mask belongs to the opposite side of the body: b = -1 in the thesis (4.5).
/// @param normal of the vertex in the world @param sample the distance field at its projection
bool belongs_to_opposite_outline(const ProjectedPoint& projected, const Eigen::Vector3d& normal,
                                 const OutlineField::Sample& sample);

}  // namespace doppel
