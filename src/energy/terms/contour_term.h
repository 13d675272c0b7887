#pragma once

#include <optional>
#include <vector>

#include "doppel/energy/evidence.h"
#include "doppel/energy/terms/silhouette_term.h"
#include "doppel/energy/terms/term.h"

namespace doppel {

/// The outline of the mask belongs to the outline of the surface: the way back of `SilhouetteTerm`, for parts of the
/// mask that no outline vertex is near. For each point c of the mask's outline, the nearest outline vertex that faces
/// the same way is chosen before every step; the row is n^T (pi(v) - c), with n the outline's normal, in pixels of a
/// image 1024 wide. Points without a vertex within `farthest` have no row. Each camera counts `weight`, shared by its
/// points.
template <typename Model>
class ContourTerm : public Term<Model> {
 public:
  /// @param cameras without distortion, @param frame what they saw; both must outlive the term
  /// @param most points of a camera @param farthest reference pixels
  ContourTerm(const std::vector<Camera>& cameras, const FrameEvidence& frame,
              const std::vector<OutlineVertex>& vertices, int most, double farthest, double weight,
              const RobustKernel& kernel);

  std::string name() const override { return "contour"; }
  void freeze(const Model& model, const typename Model::State& body) override;
  void evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                typename Model::Rows& rows) const override;

 private:
  struct View {
    std::vector<OutlineField::Point> points;
    std::vector<int> vertices;
    std::vector<std::optional<int>> partner;  ///< [points] a vertex
  };
  void choose_partners(const Model& model, const typename Model::State& body, const Camera& camera, View& view) const;

  const std::vector<Camera>& cameras_;
  std::vector<View> views_;  ///< [C]
  double farthest_, weight_;
  RobustKernel kernel_;
};

}  // namespace doppel
