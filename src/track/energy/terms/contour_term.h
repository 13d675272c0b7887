#pragma once

#include <optional>
#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/terms/silhouette_term.h"
#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Pulls the outline of the surface to points of the mask's outline: the reverse of `SilhouetteTerm`, for parts of the
/// mask that are far from every outline vertex. Before each step, every point c of the mask's outline is paired with
/// the nearest outline vertex that faces the same way. The residual is n^T (pi(v) - c) - `OutlineVertex::distance`,
/// with n the normal of the mask's outline, in reference pixels (image 1024 wide). Points without a vertex within
/// `farthest` have no residual. The points of a camera share `weight` equally.
template <typename Model>
class ContourTerm : public Term<Model> {
 public:
  /// @param cameras, frame [C]; both must outlive the term
  /// @param most points of a camera @param farthest reference pixels
  /// @param weight of each camera, per squared reference pixel @param kernel in reference pixels
  ContourTerm(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
              const std::vector<OutlineVertex>& vertices, int most, double farthest, double weight,
              const RobustKernel& kernel);

  std::string name() const override { return "contour"; }
  void freeze(const Model& model, const typename Model::State& body) override;
  void evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                typename Model::Rows& rows) const override;

 private:
  struct View {
    std::vector<OutlineField::Point> points;
    std::vector<OutlineVertex> vertices;
    std::vector<std::optional<OutlineVertex>> partner;  ///< [points]
  };
  void choose_partners(const Model& model, const typename Model::State& body, const PinholeCamera& camera,
                       View& view) const;

  const std::vector<PinholeCamera>& cameras_;
  std::vector<View> views_;  ///< [C]
  double farthest_, weight_;
  RobustKernel kernel_;
};

}  // namespace doppel
