#include "doppel/synth/clothing.h"

#include <algorithm>
#include <cmath>

#include "doppel/geometry/topology.h"

namespace doppel::synth {

namespace {

using Eigen::Vector3d;

/// The path of one vertex between frames: the cubic through frame f and f+1 with central-difference tangents.
struct Path {
  Vector3d p0, p1, m0, m1;  ///< ends, and tangents per frame

  Vector3d velocity(double s) const {
    return (6 * s * s - 6 * s) * (p0 - p1) + (3 * s * s - 4 * s + 1) * m0 + (3 * s * s - 2 * s) * m1;
  }
  Vector3d acceleration(double s) const { return (12 * s - 6) * (p0 - p1) + (6 * s - 4) * m0 + (6 * s - 2) * m1; }
};

Path path_of(const std::vector<Points>& frames, std::size_t f, std::size_t v) {
  const auto at = [&](long k) -> const Vector3d& {
    return frames[std::clamp<long>(k, 0, static_cast<long>(frames.size()) - 1)][v];
  };
  const long k = static_cast<long>(f);
  return {at(k), at(k + 1), 0.5 * (at(k + 1) - at(k - 1)), 0.5 * (at(k + 2) - at(k))};
}

/// Displacements and velocities of all vertices, integrated together.
class SpringCloth {
 public:
  SpringCloth(const Actor& actor, double fps, const ClothingOptions& options)
      : looseness_(actor.looseness),
        topology_(actor.character.mesh),
        options_(options),
        fps_(fps),
        u_(looseness_.size(), Vector3d::Zero()),
        velocity_(u_),
        next_(u_) {
    // Waves must have the same speed on any mesh, so the coupling is proportional to the inverse square of the edge
    // length.
    coupling_ = options.coupling * looseness_.size() / 5000.0;
  }

  void advance_frame(const std::vector<Points>& worn, std::size_t f) {
    std::vector<Path> paths(u_.size());
    for (std::size_t v = 0; v < u_.size(); ++v)
      if (looseness_[v] > kTight) paths[v] = path_of(worn, f, v);
    const double dt = 1 / (fps_ * options_.substeps);
    for (int k = 0; k < options_.substeps; ++k) step(paths, (k + 0.5) / options_.substeps, dt);
  }

  Points surface(const Points& worn) const {
    Points result = worn;
    for (std::size_t v = 0; v < u_.size(); ++v) {
      // A soft limit of the displacement.
      const double reach = options_.reach * std::max(looseness_[v], 1e-6);
      result[v] += u_[v] / std::sqrt(1 + u_[v].squaredNorm() / (reach * reach));
    }
    return result;
  }

 private:
  static constexpr double kTight = 1e-3;

  void step(const std::vector<Path>& paths, double s, double dt) {
    const IndexRows& ring = topology_.one_ring();
    for (std::size_t v = 0; v < u_.size(); ++v) {
      if (looseness_[v] <= kTight) continue;
      Vector3d pull = Vector3d::Zero();
      for (const int w : ring.row(static_cast<int>(v))) pull += u_[w] - u_[v];
      const Vector3d body = paths[v].velocity(s) * fps_, body_acceleration = paths[v].acceleration(s) * (fps_ * fps_);
      // Tighter cloth has stiffer springs, so it moves less and oscillates faster.
      const double held = options_.stiffness / std::max(looseness_[v], 0.05);
      const Vector3d force = -held * u_[v] - options_.damping * velocity_[v] - options_.air * (body + velocity_[v]) -
                             options_.inertia * body_acceleration + coupling_ / ring.size(static_cast<int>(v)) * pull;
      velocity_[v] += dt * force;
      next_[v] = u_[v] + dt * velocity_[v];
    }
    u_.swap(next_);
  }

  const std::vector<double>& looseness_;
  MeshTopology topology_;
  ClothingOptions options_;
  double fps_, coupling_;
  Points u_, velocity_, next_;
};

}  // namespace

std::vector<Points> move_clothes(const Actor& actor, const std::vector<Points>& worn, double fps,
                                 const ClothingOptions& options) {
  SpringCloth cloth(actor, fps, options);
  std::vector<Points> surfaces;
  for (std::size_t f = 0; f < worn.size(); ++f) {
    surfaces.push_back(cloth.surface(worn[f]));
    cloth.advance_frame(worn, f);
  }
  return surfaces;
}

}  // namespace doppel::synth
