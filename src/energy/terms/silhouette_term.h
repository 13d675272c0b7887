#pragma once

#include <optional>
#include <vector>

#include "doppel/energy/evidence.h"
#include "doppel/energy/terms/term.h"

namespace doppel {

/// A vertex on the outline of the posed surface, as one camera sees it.
struct OutlineVertex {
  int camera = 0, vertex = 0;
  /// Where it lies to the outline that it stands for, pixels of an image 1024 wide, - inside: as vertices are not
  /// dense, most lie a little within the outline of the surface, and are to lie as much within the outline of the mask.
  double distance = 0.0;
};

/// The outline of the surface belongs on the outline of the mask (4.5): for each outline vertex the distance of its
/// projection to the mask's outline, in pixels of an image 1024 wide. Each camera counts `weight`, shared by its
/// vertices, so that a finer mesh does not count more.
///
/// A vertex inside the mask whose normal points away from the nearest outline belongs to the opposite one (b = -1 in
/// the thesis). Its residual stays |d| while its jacobian is negated: that is the residual
/// d - 2 d0 with d0 the distance at the pose the step starts from, which is what a row here holds. So the cost falls
/// along the step, and a damped solver can tell a good one.
template <typename Model>
class SilhouetteTerm : public Term<Model> {
 public:
  /// @param cameras without distortion, @param frame what they saw; both must outlive the term
  SilhouetteTerm(const std::vector<Camera>& cameras, const FrameEvidence& frame, std::vector<OutlineVertex> vertices,
                 double weight, double inside, const RobustKernel& kernel);

  std::string name() const override { return "silhouette"; }
  void freeze(const Model& model, const typename Model::State& body) override;
  void evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                typename Model::Rows& rows) const override;
  void linearise(const Model& model, const typename Model::State& body, typename Model::Rows& rows) override;

 private:
  /// Where a vertex is, and the mask's outline from there. Not to be asked for without a field.
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

  const std::vector<Camera>& cameras_;
  const FrameEvidence& frame_;
  std::vector<OutlineVertex> vertices_;
  std::vector<double> weights_;  ///< [vertices]
  std::vector<double> targets_;  ///< [vertices] distance that the row is measured from, reference pixels
  double inside_;                ///< what a row within the mask is multiplied with
  RobustKernel kernel_;
};

/// Whether a vertex inside the mask is drawn to the wrong side of the body: -1 in the thesis's b (4.5).
/// @param normal of the vertex in the world, @param sample the mask's distance at its projection
bool belongs_to_opposite_outline(const ProjectedPoint& projected, const Eigen::Vector3d& normal,
                                 const OutlineField::Sample& sample);

}  // namespace doppel
