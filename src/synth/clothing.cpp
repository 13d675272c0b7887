#include "doppel/synth/clothing.h"

#include <algorithm>
#include <cmath>

#include "doppel/geometry/topology.h"

namespace doppel::synth {

namespace {

using Eigen::Vector3d;

// Per unit of mass.
constexpr double kSpringStiffness = 55;  // 1/s², spring to the skinned position
constexpr double kSpringDamping = 4.5;   // 1/s, of the motion relative to the body
constexpr double kAirDrag = 4.0;         // 1/s, of the motion relative to the world
constexpr double kSpringCoupling = 700;  // 1/s², pull of the neighbours, for a mesh of 5,000 vertices
constexpr double kHemReach = 0.13;       // metres, largest displacement of a free hem
constexpr int kSpringSubsteps = 10;      // per frame

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
  SpringCloth(const Actor& actor, double fps)
      : looseness_(actor.looseness),
        topology_(actor.character.mesh),
        fps_(fps),
        u_(looseness_.size(), Vector3d::Zero()),
        velocity_(u_),
        next_(u_) {
    // Waves must have the same speed on any mesh, so the coupling is proportional to the inverse square of the edge
    // length.
    coupling_ = kSpringCoupling * looseness_.size() / 5000.0;
  }

  void advance_frame(const std::vector<Points>& worn, std::size_t f) {
    std::vector<Path> paths(u_.size());
    for (std::size_t v = 0; v < u_.size(); ++v)
      if (looseness_[v] > kTight) paths[v] = path_of(worn, f, v);
    const double dt = 1 / (fps_ * kSpringSubsteps);
    for (int k = 0; k < kSpringSubsteps; ++k) step(paths, (k + 0.5) / kSpringSubsteps, dt);
  }

  Points surface(const Points& worn) const {
    Points result = worn;
    for (std::size_t v = 0; v < u_.size(); ++v) {
      // A soft limit of the displacement.
      const double reach = kHemReach * std::max(looseness_[v], 1e-6);
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
      const double held = kSpringStiffness / std::max(looseness_[v], 0.05);
      const Vector3d force = -held * u_[v] - kSpringDamping * velocity_[v] - kAirDrag * (body + velocity_[v]) -
                             body_acceleration + coupling_ / ring.size(static_cast<int>(v)) * pull;
      velocity_[v] += dt * force;
      next_[v] = u_[v] + dt * velocity_[v];
    }
    u_.swap(next_);
  }

  const std::vector<double>& looseness_;
  MeshTopology topology_;
  double fps_, coupling_;
  Points u_, velocity_, next_;
};

}  // namespace

std::vector<Points> move_clothes(const Actor& actor, const std::vector<Points>& worn, double fps) {
  SpringCloth cloth(actor, fps);
  std::vector<Points> surfaces;
  for (std::size_t f = 0; f < worn.size(); ++f) {
    surfaces.push_back(cloth.surface(worn[f]));
    cloth.advance_frame(worn, f);
  }
  return surfaces;
}

}  // namespace doppel::synth
