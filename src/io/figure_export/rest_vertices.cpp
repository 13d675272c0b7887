#include "doppel/geometry/decompositions.h"
#include "doppel/io/figure_export/figure_clip.h"

namespace doppel {
namespace {

/// Damping for each frame, of vertices whose blended matrices are all nearly singular.
constexpr double kRestDamping = 1e-3;

}  // namespace

std::vector<Eigen::Vector3d> fitted_rest_vertices(const Figure& figure, const Skeleton& skeleton,
                                                  const FigureClip& clip) {
  std::vector<Eigen::Vector3d> rest = figure.rest_vertices;
  if (clip.num_frames() == 0) return rest;
  const Eigen::Matrix3d damping = kRestDamping * clip.num_frames() * Eigen::Matrix3d::Identity();
  std::vector<Eigen::Matrix3d> normal(rest.size(), damping);
  std::vector<Eigen::Vector3d> right(rest.size(), Eigen::Vector3d::Zero());
  for (int t = 0; t < clip.num_frames(); ++t) {
    const auto blended = blend_transforms(figure, pose_nodes(figure, skeleton, clip.dofs[t]));
    for (std::size_t v = 0; v < rest.size(); ++v) {
      const float* wanted = &clip.vertices[t][3 * v];
      const Eigen::Matrix3d M = blended[v].linear();
      normal[v] += M.transpose() * M;
      right[v] +=
          M.transpose() * (Eigen::Vector3d(wanted[0], wanted[1], wanted[2]) - blended[v] * figure.rest_vertices[v]);
    }
  }
  for (std::size_t v = 0; v < rest.size(); ++v) rest[v] += solve_symmetric(normal[v], right[v]);
  return rest;
}

}  // namespace doppel
