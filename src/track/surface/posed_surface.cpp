#include "doppel/track/surface/posed_surface.h"

#include "doppel/solver/parallel.h"

namespace doppel {

PosedSurface pose_surface(const PoseModel& model, const PosedBody& body, const std::vector<Eigen::Vector3d>& rest) {
  PosedSurface surface;
  surface.vertices.resize(3, static_cast<Eigen::Index>(rest.size()));
  surface.normals.resize(rest.size());
  surface.turns.resize(rest.size());
  for_parts(rest.size(), [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      const int vertex = static_cast<int>(i);
      const Eigen::Affine3d movement = model.movement(body, vertex);
      surface.vertices.col(vertex) = movement * rest[i];
      surface.turns[i] = movement.linear();
      surface.normals[i] = movement.linear() * model.rest_normal(vertex);
    }
  });
  return surface;
}

}  // namespace doppel
