#include "doppel/track/energy/terms/match_term.h"

namespace doppel {

template <typename Model>
MatchTerm<Model>::MatchTerm(const std::vector<PinholeCamera>& cameras, std::vector<SurfaceMatch> matches, double weight,
                            const RobustKernel& kernel)
    : cameras_(cameras), matches_(std::move(matches)), weight_(weight), kernel_(kernel) {}

template <typename Model>
void MatchTerm<Model>::evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                                typename Model::Rows& rows) const {
  rows.reset(model.num_unknowns(), 2, kernel_, jacobian);
  for (const SurfaceMatch& match : matches_) {
    const PinholeCamera& camera = cameras_[match.camera];
    const Eigen::Index first = rows.add_group(weight_);
    const auto vertex = model.skinned(body, match.vertex);
    const auto projected = project_with_jacobian(camera, vertex.position());
    if (!projected) {
      rows.value(first) = kBehindCamera;
      continue;
    }
    const Eigen::Matrix2d scaled = reference_pixels(camera) * match.sureness;
    const Eigen::Vector2d error = scaled * (projected->pixel - match.pixel);
    const Eigen::Matrix<double, 2, 3> gradient = scaled * projected->jacobian;
    for (int k = 0; k < 2; ++k) {
      rows.value(first + k) = error[k];
      if (jacobian) model.add_vertex_jacobian(body, vertex, gradient.row(k).transpose(), rows.jacobian(first + k));
    }
  }
}

template class MatchTerm<PoseModel>;

}  // namespace doppel
