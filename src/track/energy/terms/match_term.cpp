#include "doppel/track/energy/terms/match_term.h"

namespace doppel {

std::optional<MatchResidual> match_residual(const SurfaceMatch& match, const PinholeCamera& camera,
                                            const Eigen::Vector3d& vertex) {
  const auto projected = project_with_jacobian(camera, vertex);
  if (!projected) return std::nullopt;
  const Eigen::Matrix2d scaled = reference_pixels(camera) * match.sureness;
  return MatchResidual{scaled * (projected->pixel - match.pixel), scaled * projected->jacobian};
}

MatchTerm::MatchTerm(const std::vector<PinholeCamera>& cameras, std::vector<SurfaceMatch> matches, double weight,
                     const RobustKernel& kernel)
    : cameras_(cameras), matches_(std::move(matches)), weight_(weight), kernel_(kernel) {}

void MatchTerm::evaluate(const PoseModel& model, const PosedBody& body, bool jacobian, Rows& rows) const {
  rows.reset(model.num_unknowns(), 2, kernel_, jacobian);
  for (const SurfaceMatch& match : matches_) {
    const Eigen::Index first = rows.add_group(weight_);
    const auto vertex = model.skinned(body, match.vertex);
    const auto residual = match_residual(match, cameras_[match.camera], vertex.position());
    if (!residual) {
      rows.value(first) = kBehindCamera;
      continue;
    }
    for (int k = 0; k < 2; ++k) {
      rows.value(first + k) = residual->value[k];
      if (jacobian)
        model.add_vertex_jacobian(body, vertex, residual->jacobian.row(k).transpose(), rows.jacobian(first + k));
    }
  }
}

}  // namespace doppel
