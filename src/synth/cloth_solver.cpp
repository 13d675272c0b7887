#include "doppel/synth/cloth_solver.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "doppel/geometry/topology.h"

namespace doppel::synth {

namespace {

using Eigen::Vector3d;

/// The angle between the faces (a, b, c) and (b, a, d), 0 when flat, and its gradients.
struct Hinge {
  Hinge(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
    const Vector3d edge = b - a, n = edge.cross(c - a), m = (d - a).cross(edge);
    const double length = edge.norm(), nn = n.squaredNorm(), mm = m.squaredNorm();
    valid = length > 1e-9 && nn > 1e-20 && mm > 1e-20;
    if (!valid) return;
    angle = std::atan2(edge.dot(n.cross(m)) / length, n.dot(m));
    of_c = -length / nn * n;
    of_d = -length / mm * m;
    // A vertex of the edge turns a face as much as the opposite vertex does, in proportion to the foot of its height.
    const double s = edge.dot(c - a) / (length * length), t = edge.dot(d - a) / (length * length);
    of_a = -(1 - s) * of_c - (1 - t) * of_d;
    of_b = -s * of_c - t * of_d;
  }

  bool valid;  ///< false for a face without area
  double angle = 0;
  Vector3d of_a, of_b, of_c, of_d;
};

/// Number of edges from each vertex to the nearest held vertex.
std::vector<int> hops_from(const std::vector<char>& held, const MeshTopology& topology) {
  std::vector<int> hops(held.size(), static_cast<int>(held.size())), front;
  for (std::size_t v = 0; v < held.size(); ++v)
    if (held[v]) hops[v] = 0, front.push_back(static_cast<int>(v));
  for (std::size_t k = 0; k < front.size(); ++k)
    for (const int w : topology.one_ring().row(front[k]))
      if (hops[w] > hops[front[k]] + 1) hops[w] = hops[front[k]] + 1, front.push_back(w);
  return hops;
}

double area(const std::vector<Vector3d>& x, const Triangle& f) {
  return 0.5 * (x[f[1]] - x[f[0]]).cross(x[f[2]] - x[f[0]]).norm();
}

}  // namespace

ClothSolver::ClothSolver(const Cloth& cloth, const XpbdOptions& options)
    : options_(options), faces_(cloth.faces), mobility_(cloth.rest.size(), 0.0) {
  for (const Triangle& f : faces_)
    for (const int v : f) mobility_[v] += options.density / 3 * area(cloth.rest, f);
  for (std::size_t v = 0; v < mobility_.size(); ++v)
    mobility_[v] = cloth.held[v] || mobility_[v] <= 0 ? 0.0 : 1 / mobility_[v];
  add_edges(cloth);
  add_folds(cloth);
  move_to(cloth.rest);
}

void ClothSolver::add_edges(const Cloth& cloth) {
  TriangleMesh mesh;
  mesh.vertices = cloth.rest;
  mesh.faces = cloth.faces;
  const MeshTopology topology(mesh);
  for (const auto& [a, b] : topology.edges()) {
    const bool knitted = cloth.knitted[a] || cloth.knitted[b];
    if (mobility_[a] + mobility_[b] > 0)
      edges_.push_back({a, b, (cloth.rest[a] - cloth.rest[b]).norm(), knitted ? options_.knit : options_.stretch});
  }
  // From the held vertices outwards, so that one pass carries a correction through the whole cloth.
  const std::vector<int> hops = hops_from(cloth.held, topology);
  std::stable_sort(edges_.begin(), edges_.end(), [&](const Edge& p, const Edge& q) {
    return std::min(hops[p.a], hops[p.b]) < std::min(hops[q.a], hops[q.b]);
  });
}

void ClothSolver::add_folds(const Cloth& cloth) {
  struct Side {
    int opposite;
    double area;
  };
  std::map<std::array<int, 2>, Side> sides;
  for (const Triangle& f : cloth.faces)
    for (int k = 0; k < 3; ++k) sides[{f[k], f[(k + 1) % 3]}] = {f[(k + 2) % 3], area(cloth.rest, f)};
  for (const auto& [edge, left] : sides) {
    const auto [a, b] = edge;
    const auto other = sides.find({b, a});
    if (a > b || other == sides.end()) continue;
    const Side& right = other->second;
    const Hinge hinge(cloth.rest[a], cloth.rest[b], cloth.rest[left.opposite], cloth.rest[right.opposite]);
    if (!hinge.valid || mobility_[a] + mobility_[b] + mobility_[left.opposite] + mobility_[right.opposite] == 0)
      continue;
    // The energy of a fold, 1/2 (rigidity length² / area) angle², is that of a bent sheet with the area of both faces.
    const double shape = (left.area + right.area) / (cloth.rest[a] - cloth.rest[b]).squaredNorm();
    folds_.push_back({a, b, left.opposite, right.opposite, hinge.angle, options_.bending * shape});
  }
}

void ClothSolver::move_to(const std::vector<Vector3d>& positions) {
  x_ = before_ = positions;
  velocity_.assign(positions.size(), Vector3d::Zero());
}

void ClothSolver::step(double dt, const std::vector<Vector3d>& held, const Obstacle* obstacle) {
  slow_by_air(dt);
  predict(dt, held);
  for (const Fold& fold : folds_) keep_angle(fold, dt);
  for (const Edge& edge : edges_) keep_length(edge, dt);
  for (std::size_t v = 0; v < x_.size(); ++v) {
    if (obstacle && mobility_[v] > 0) leave_body(static_cast<int>(v), *obstacle);
    velocity_[v] = (x_[v] - before_[v]) / dt;
  }
}

void ClothSolver::slow_by_air(double dt) {
  normals_.assign(x_.size(), Vector3d::Zero());
  for (const Triangle& f : faces_) {
    const Vector3d normal = (x_[f[1]] - x_[f[0]]).cross(x_[f[2]] - x_[f[0]]);
    for (const int v : f) normals_[v] += normal;
  }
  for (std::size_t v = 0; v < x_.size(); ++v) {
    velocity_[v] /= 1 + options_.loss * dt;
    const double size = normals_[v].norm();
    if (size < 1e-12) continue;
    const Vector3d normal = normals_[v] / size;
    const double speed = velocity_[v].dot(normal);
    // Implicit in the speed, so that no step reverses it.
    const double slower = speed / (1 + options_.drag * std::abs(speed) * dt);
    velocity_[v] += (slower - speed) * normal;
  }
}

void ClothSolver::predict(double dt, const std::vector<Vector3d>& held) {
  before_ = x_;
  for (std::size_t v = 0; v < x_.size(); ++v) {
    if (mobility_[v] == 0) {
      x_[v] = held[v];
      continue;
    }
    velocity_[v].y() -= dt * options_.gravity;
    const double speed = velocity_[v].norm();
    if (speed > options_.speed) velocity_[v] *= options_.speed / speed;
    x_[v] += dt * velocity_[v];
  }
}

void ClothSolver::keep_length(const Edge& e, double dt) {
  const Vector3d between = x_[e.b] - x_[e.a];
  const double length = between.norm(), w = mobility_[e.a] + mobility_[e.b];
  if (length < 1e-9) return;
  const Vector3d push = (e.length - length) / (w + e.compliance / (dt * dt)) / length * between;
  x_[e.a] -= mobility_[e.a] * push;
  x_[e.b] += mobility_[e.b] * push;
}

void ClothSolver::keep_angle(const Fold& f, double dt) {
  const Hinge hinge(x_[f.a], x_[f.b], x_[f.c], x_[f.d]);
  if (!hinge.valid) return;
  const double off = std::remainder(hinge.angle - f.angle, 2 * M_PI);
  const double w = mobility_[f.a] * hinge.of_a.squaredNorm() + mobility_[f.b] * hinge.of_b.squaredNorm() +
                   mobility_[f.c] * hinge.of_c.squaredNorm() + mobility_[f.d] * hinge.of_d.squaredNorm();
  const double turned = hinge.of_a.dot(x_[f.a] - before_[f.a]) + hinge.of_b.dot(x_[f.b] - before_[f.b]) +
                        hinge.of_c.dot(x_[f.c] - before_[f.c]) + hinge.of_d.dot(x_[f.d] - before_[f.d]);
  const double damping = options_.damping / dt;
  const double push = -(off + damping * turned) / ((1 + damping) * w + f.compliance / (dt * dt));
  x_[f.a] += mobility_[f.a] * push * hinge.of_a;
  x_[f.b] += mobility_[f.b] * push * hinge.of_b;
  x_[f.c] += mobility_[f.c] * push * hinge.of_c;
  x_[f.d] += mobility_[f.d] * push * hinge.of_d;
}

void ClothSolver::leave_body(int v, const Obstacle& obstacle) {
  constexpr int kRounds = 4;  // out of one part, perhaps into another
  for (int round = 0; round < kRounds; ++round) {
    const std::optional<Touch> touch = obstacle.touch(v, x_[v]);
    if (!touch) return;
    x_[v] += touch->depth * touch->normal;
    const Vector3d slide = x_[v] - before_[v] - touch->motion;
    const double away = slide.dot(touch->normal);
    const Vector3d along = slide - away * touch->normal;
    const double allowed = options_.friction * touch->depth, length = along.norm();
    x_[v] -= length > allowed ? Vector3d(along * (allowed / length)) : along;
    // A vertex that starts deep inside must not leave the body with the speed of its correction.
    if (away > 0) before_[v] += away * touch->normal;
  }
}

}  // namespace doppel::synth
