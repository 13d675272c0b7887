#pragma once

#include <optional>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel::synth {

/// Parameters of the position-based cloth. The stiffness of a real cloth is a number per metre, so the same values fit
/// any mesh.
struct XpbdOptions {
  double density = 0.25;     ///< kg/m²
  double stretch = 2e-4;     ///< m/N, compliance of an edge of woven cloth (the skirt)
  double knit = 2e-2;        ///< m/N, compliance of an edge of knitted cloth (the pullover)
  double bending = 3000;     ///< 1/(N m), compliance of a fold: the inverse of the flexural rigidity
  double damping = 0.004;    ///< seconds, of folds: their damping divided by their stiffness
  double gravity = 9.81;     ///< m/s²
  double drag = 3.0;         ///< 1/m, deceleration by air divided by the square of the speed along the normal
  double loss = 1.0;         ///< 1/s, deceleration divided by the speed: all other losses
  double friction = 0.35;    ///< Coulomb's coefficient between cloth and body
  double thickness = 0.004;  ///< metres, distance that the cloth keeps from the body
  double speed = 15;         ///< m/s, largest speed of a vertex
  double reach = 0.6;        ///< metres, largest distance of a vertex from its skinned position
  double pinned = 0.02;      ///< vertices below this looseness follow the body
  double step = 1e-3;        ///< seconds, largest time step of the simulation
};

/// Cloth as a triangle mesh with V vertices.
struct Cloth {
  std::vector<Eigen::Vector3d> rest;  ///< [V] metres; edges have their natural length here, folds their natural angle
  std::vector<Triangle> faces;        ///< [F]
  std::vector<char> held;             ///< [V] 1: the caller moves the vertex
  std::vector<char> knitted;          ///< [V] 1: knitted, 0: woven
};

/// A vertex that is below the surface of a body.
struct Touch {
  double depth = 0;                                  ///< metres, > 0
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, out of the body
  Eigen::Vector3d motion = Eigen::Vector3d::Zero();  ///< of the body there during the step, metres
};

/// Bodies that the cloth can't enter.
class Obstacle {
 public:
  virtual ~Obstacle() = default;
  /// The deepest contact of a vertex at p, if there is one.
  virtual std::optional<Touch> touch(int vertex, const Eigen::Vector3d& p) const = 0;
};

/// Extended position-based dynamics of a cloth (Macklin et al. 2016), with one iteration per small step (2019).
///
/// A step moves the vertices by their velocity, then corrects the positions, one constraint after the other:
///
///   dx_i = w_i grad_i C dl,   dl = -(C + g grad C . (x - x_before)) / ((1 + g) sum_i w_i |grad_i C|² + a / dt²)
///
/// with C = length - rest length for an edge and C = angle - rest angle for a fold, w the inverse mass, a the
/// compliance and g = damping time / dt (folds only). At last, vertices inside a body move out along its normal, and
/// friction shortens their motion along the surface by at most `friction` times the depth. The velocity is the motion
/// divided by dt. Contacts are inelastic.
///
/// The order of the constraints is fixed, so the result depends on the arguments only.
class ClothSolver {
 public:
  ClothSolver(const Cloth& cloth, const XpbdOptions& options);

  /// Moves all vertices; their velocities are 0. @param positions [V]
  void move_to(const std::vector<Eigen::Vector3d>& positions);
  /// Advances by dt seconds.
  /// @param held [V] positions of the held vertices at the end of the step; the other entries are not read
  void step(double dt, const std::vector<Eigen::Vector3d>& held, const Obstacle* obstacle = nullptr);

  const std::vector<Eigen::Vector3d>& positions() const { return x_; }
  const std::vector<Eigen::Vector3d>& velocities() const { return velocity_; }

 private:
  struct Edge {
    int a, b;
    double length, compliance;
  };
  /// The edge a, b with the opposite vertices c and d of its two faces.
  struct Fold {
    int a, b, c, d;
    double angle, compliance;
  };

  void add_edges(const Cloth& cloth);
  void add_folds(const Cloth& cloth);
  void slow_by_air(double dt);
  void predict(double dt, const std::vector<Eigen::Vector3d>& held);
  void keep_length(const Edge& edge, double dt);
  void keep_angle(const Fold& fold, double dt);
  void leave_body(int v, const Obstacle& obstacle);

  XpbdOptions options_;
  std::vector<Triangle> faces_;
  std::vector<Edge> edges_;
  std::vector<Fold> folds_;
  std::vector<double> mobility_;  ///< [V] inverse mass, 1/kg, 0 for held vertices
  std::vector<Eigen::Vector3d> x_, before_, velocity_, normals_;
};

}  // namespace doppel::synth
