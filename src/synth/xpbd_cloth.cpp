#include "doppel/synth/xpbd_cloth.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/process.h"
#include "doppel/geometry/decompositions.h"
#include "doppel/geometry/topology.h"
#include "doppel/synth/posed_body.h"

namespace doppel::synth {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The value between frames f and f+1: the cubic through both with central-difference tangents.
/// @param at the value of a frame @param s 0..1
template <typename Value, typename At>
Value between_frames(const At& at, std::size_t f, std::size_t frames, double s) {
  const auto clamped = [&](long k) -> Value {
    return at(as_size(std::clamp<long>(k, 0, static_cast<long>(frames) - 1)));
  };
  const long k = static_cast<long>(f);
  const Value p0 = clamped(k), p1 = clamped(k + 1);
  const Value m0 = 0.5 * (p1 - clamped(k - 1)), m1 = 0.5 * (clamped(k + 2) - p0);
  return p0 + s * s * (3 - 2 * s) * (p1 - p0) + s * (1 - s) * (1 - s) * m0 - s * s * (1 - s) * m1;
}

/// [N] the clothes as worn, in the rest pose
Points worn_at_rest(const Actor& actor) {
  Points rest = actor.character.mesh.vertices;
  for (std::size_t v = 0; v < rest.size(); ++v) rest[v] += actor.hang[v];
  return rest;
}

/// The faces that move as cloth, and their vertices.
struct ClothPart {
  ClothPart(const Actor& actor, const std::vector<ClothRole>& roles);

  Cloth cloth;
  std::vector<int> vertex;  ///< [V] of the actor
};

ClothPart::ClothPart(const Actor& actor, const std::vector<ClothRole>& roles) {
  const Points rest = worn_at_rest(actor);
  std::vector<int> index(rest.size(), -1);
  const auto indexed = [&](int v) {
    if (index[v] < 0) {
      index[v] = static_cast<int>(vertex.size());
      vertex.push_back(v);
      cloth.rest.push_back(rest[v]);
      cloth.held.push_back(roles[v] == ClothRole::skin);
      cloth.knitted.push_back(roles[v] == ClothRole::knitted);
    }
    return index[v];
  };
  const auto has = [&](const Triangle& face, ClothRole role) {
    return std::any_of(face.begin(), face.end(), [&](int v) { return roles[v] == role; });
  };
  for (const Triangle& f : actor.character.mesh.faces)
    if ((has(f, ClothRole::woven) || has(f, ClothRole::knitted)) && !has(f, ClothRole::lining))
      cloth.faces.push_back({indexed(f[0]), indexed(f[1]), indexed(f[2])});
}

/// What the clothes touch: the body, the skin, and the limit of their displacement.
class Surroundings : public Obstacle {
 public:
  Surroundings(const Actor& actor, const std::vector<ClothRole>& roles, const std::vector<int>& actor_vertex,
               const XpbdOptions& options)
      : actor_(actor), roles_(roles), actor_vertex_(actor_vertex), options_(options), body_(actor), skin_(actor) {
    mesh_.faces = actor.character.mesh.faces;
  }

  /// @param worn [N] skinned positions @param dofs [D] of the same time
  void move(const Points& worn, const std::vector<double>& dofs);
  /// @param vertex of the cloth
  std::optional<Touch> touch(int vertex, const Vector3d& p) const override;
  /// The deeper of the contacts with trunk and limbs and with the skin.
  std::optional<Touch> touch_body(const Vector3d& p, double thickness) const;
  const Points& worn() const { return mesh_.vertices; }

 private:
  std::optional<Touch> touch_under_pullover(int v, const Vector3d& p) const;

  const Actor& actor_;
  const std::vector<ClothRole>& roles_;
  const std::vector<int>& actor_vertex_;
  XpbdOptions options_;
  PosedBody body_;
  SkinPatch skin_;
  TriangleMesh mesh_;    ///< skinned positions at the end of the step
  Points worn_before_;   ///< [N] and at its start
  Points worn_normals_;  ///< [N]
};

void Surroundings::move(const Points& worn, const std::vector<double>& dofs) {
  worn_before_ = mesh_.vertices.empty() ? worn : mesh_.vertices;
  mesh_.vertices = worn;
  worn_normals_ = vertex_normals(mesh_);
  skin_.move(worn);
  body_.move(dofs);
}

std::optional<Touch> Surroundings::touch(int vertex, const Vector3d& p) const {
  const int v = actor_vertex_[vertex];
  const Vector3d off = p - worn()[v];
  const double away = off.norm();
  if (away > options_.reach) return Touch{away - options_.reach, -off / away, worn()[v] - worn_before_[v]};
  return roles_[v] == ClothRole::knitted ? touch_under_pullover(v, p) : touch_body(p, options_.thickness);
}

std::optional<Touch> Surroundings::touch_under_pullover(int v, const Vector3d& p) const {
  // The pullover as worn is off the skin by its offset. It may come nearer by this share of the offset.
  constexpr double kNearer = 0.7;
  const double depth = worn_normals_[v].dot(worn()[v] - p) - kNearer * actor_.hang[v].norm();
  if (depth <= 0) return std::nullopt;
  return Touch{depth, worn_normals_[v], worn()[v] - worn_before_[v]};
}

std::optional<Touch> Surroundings::touch_body(const Vector3d& p, double thickness) const {
  constexpr double kSkinAbove = 0.06;  // metres, more than the skin is above the rigid parts anywhere
  const double distance = body_.distance(p);
  if (distance > kSkinAbove + thickness) return std::nullopt;
  std::optional<Touch> touch = skin_.touch(p, thickness);
  if (distance < thickness && (!touch || thickness - distance > touch->depth)) touch = body_.touch(p, thickness);
  return touch;
}

/// The inner wall of the skirt, which follows the outer face.
class Lining {
 public:
  Lining(const Actor& actor, const std::vector<ClothRole>& roles);
  /// Moves the lining's vertices. @param surface [N] with the cloth in place @param worn [N] skinned positions
  void follow(Points& surface, const Points& worn);

 private:
  /// A vertex of the wall, and the vertices of the outer face near it.
  struct Rider {
    int vertex;
    std::vector<int> carriers;
    std::vector<double> weights;  ///< sum 1
  };
  void add(int v, const std::vector<ClothRole>& roles);
  Vector3d carried(const Rider& rider, const Points& surface) const;

  Points rest_, u_;  ///< [N] position in the rest pose, displacement from the skinned position
  MeshTopology topology_;
  std::vector<Rider> riders_;
  std::vector<int> ceiling_;  ///< vertices far from the outer face
};

Lining::Lining(const Actor& actor, const std::vector<ClothRole>& roles)
    : rest_(worn_at_rest(actor)), u_(rest_.size(), Vector3d::Zero()), topology_(actor.character.mesh) {
  for (std::size_t v = 0; v < roles.size(); ++v)
    if (roles[v] == ClothRole::lining) add(static_cast<int>(v), roles);
}

void Lining::add(int v, const std::vector<ClothRole>& roles) {
  constexpr double kWall = 0.05, kAround = 0.06;  // metres, from the outer face and to the carriers
  constexpr std::size_t kMinNeighbours = 6;
  std::vector<std::pair<double, int>> near;
  for (std::size_t w = 0; w < roles.size(); ++w)
    if (roles[w] == ClothRole::woven) near.emplace_back((rest_[v] - rest_[w]).norm(), static_cast<int>(w));
  std::sort(near.begin(), near.end());
  if (near.size() < kMinNeighbours || near.front().first > kWall) {
    ceiling_.push_back(v);
    return;
  }
  const double around = std::max(kAround, 1.01 * near[kMinNeighbours - 1].first);
  Rider rider{v, {}, {}};
  double sum = 0;
  for (const auto& [distance, w] : near) {
    if (distance >= around) break;
    const double inside = 1 - distance * distance / (around * around);
    rider.carriers.push_back(w);
    rider.weights.push_back(inside * inside);
    sum += inside * inside;
  }
  for (double& weight : rider.weights) weight /= sum;
  riders_.push_back(std::move(rider));
}

/// The position of a rider after the rigid motion that fits its carriers best.
Vector3d Lining::carried(const Rider& rider, const Points& surface) const {
  Vector3d from = Vector3d::Zero(), to = Vector3d::Zero();
  for (std::size_t k = 0; k < rider.carriers.size(); ++k) {
    from += rider.weights[k] * rest_[rider.carriers[k]];
    to += rider.weights[k] * surface[rider.carriers[k]];
  }
  Matrix3d spread = Matrix3d::Zero();
  for (std::size_t k = 0; k < rider.carriers.size(); ++k)
    spread += rider.weights[k] * (surface[rider.carriers[k]] - to) * (rest_[rider.carriers[k]] - from).transpose();
  const auto [U, values, V] = svd(spread);
  const bool mirrors = U.determinant() * V.determinant() < 0;
  const Vector3d sign(1, 1, mirrors ? -1 : 1);
  const Matrix3d turn = U * sign.asDiagonal() * V.transpose();
  return to + turn * (rest_[rider.vertex] - from);
}

void Lining::follow(Points& surface, const Points& worn) {
  for (const Rider& rider : riders_) {
    surface[rider.vertex] = carried(rider, surface);
    u_[rider.vertex] = surface[rider.vertex] - worn[rider.vertex];
  }
  // The ceiling between wall and legs: its displacement is harmonic, from that of the wall to 0 at the legs. The sweeps
  // start from the displacement of the last frame.
  constexpr int kSweeps = 40;
  const IndexRows& ring = topology_.one_ring();
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (const int v : ceiling_) {
      u_[v].setZero();
      for (const int w : ring.row(v)) u_[v] += u_[w] / ring.size(v);
    }
  for (const int v : ceiling_) surface[v] = worn[v] + u_[v];
}

/// The clothes of the actor in motion.
class Drape {
 public:
  Drape(const Actor& actor, const std::vector<Points>& worn, const Motion& motion, double fps,
        const XpbdOptions& options);
  Points surface(std::size_t f);
  void advance_frame(std::size_t f);

 private:
  void move_body(std::size_t f, double s);

  const std::vector<Points>& worn_;
  const Motion& motion_;
  XpbdOptions options_;
  int steps_;  ///< per frame
  double dt_;
  std::vector<ClothRole> roles_;
  ClothPart part_;
  Surroundings surroundings_;
  Lining lining_;
  ClothSolver solver_;
};

Drape::Drape(const Actor& actor, const std::vector<Points>& worn, const Motion& motion, double fps,
             const XpbdOptions& options)
    : worn_(worn),
      motion_(motion),
      options_(options),
      steps_(std::max(1, static_cast<int>(std::ceil(1 / (fps * options.step) - 1e-9)))),
      dt_(1 / (fps * steps_)),
      roles_(cloth_roles(actor, options.pinned)),
      part_(actor, roles_),
      surroundings_(actor, roles_, part_.vertex, options),
      lining_(actor, roles_),
      solver_(part_.cloth, options) {
  Points start;
  for (const int v : part_.vertex) start.push_back(worn[0][v]);
  solver_.move_to(start);
  move_body(0, 0);
}

/// Moves the body to the time s between frames f and f+1.
void Drape::move_body(std::size_t f, double s) {
  Points worn;
  for (std::size_t v = 0; v < roles_.size(); ++v)
    worn.push_back(between_frames<Vector3d>([&](std::size_t k) { return worn_[k][v]; }, f, worn_.size(), s));
  std::vector<double> dofs;
  for (std::size_t d = 0; d < motion_.frames[0].size(); ++d)
    dofs.push_back(between_frames<double>([&](std::size_t k) { return motion_.frames[k][d]; }, f, worn_.size(), s));
  surroundings_.move(worn, dofs);
}

void Drape::advance_frame(std::size_t f) {
  Points held(part_.vertex.size());
  for (int k = 1; k <= steps_; ++k) {
    move_body(f, static_cast<double>(k) / steps_);
    for (std::size_t i = 0; i < held.size(); ++i) held[i] = surroundings_.worn()[part_.vertex[i]];
    solver_.step(dt_, held, &surroundings_);
  }
}

Points Drape::surface(std::size_t f) {
  Points result = worn_[f];
  for (std::size_t i = 0; i < part_.vertex.size(); ++i)
    if (!part_.cloth.held[i]) result[part_.vertex[i]] = solver_.positions()[i];
  lining_.follow(result, worn_[f]);
  // The lining is between the legs and the outer face, so it may come nearer to the legs.
  const double thickness = 0.25 * options_.thickness;
  constexpr int kRounds = 3;
  for (std::size_t v = 0; v < result.size(); ++v)
    for (int round = 0; round < kRounds && roles_[v] == ClothRole::lining; ++round)
      if (const auto touch = surroundings_.touch_body(result[v], thickness)) result[v] += touch->depth * touch->normal;
  for (const Vector3d& p : result)
    if (!p.allFinite())
      fail("simulating the clothes: frame {} has a position that is not finite; try a smaller time step", f);
  return result;
}

void check_input(const std::vector<Points>& worn, const Motion& motion, double fps, const XpbdOptions& options) {
  if (static_cast<int>(worn.size()) != motion.num_frames())
    fail("simulating the clothes: {} frames of skinned clothes, but {} poses; the numbers must be equal", worn.size(),
         motion.num_frames());
  if (!(fps > 0) || !(options.step > 0))
    fail("simulating the clothes: {} frames per second in steps of {} s; both must be above 0", fps, options.step);
  for (std::size_t f = 0; f < worn.size(); ++f) {
    const bool finite =
        std::all_of(worn[f].begin(), worn[f].end(), [](const Vector3d& p) { return p.allFinite(); }) &&
        std::all_of(motion.frames[f].begin(), motion.frames[f].end(), [](double x) { return std::isfinite(x); });
    if (!finite) fail("simulating the clothes: the pose of frame {} is not finite; correct the motion", f);
  }
}

}  // namespace

std::vector<ClothRole> cloth_roles(const Actor& actor, double pinned) {
  constexpr int kUpperClothes = 5, kTrousers = 9, kSkirtLabel = 12;
  constexpr double kBand = 0.07;        // metres, height of the waistband
  constexpr double kOuterFace = 0.012;  // metres, less than half of the depth of the inner wall
  const Character& c = actor.character;
  const BodyField field;
  std::vector<ClothRole> roles(c.mesh.vertices.size(), ClothRole::skin);
  for (std::size_t v = 0; v < roles.size(); ++v) {
    const Vector3d& p = actor.own_rest[v];
    if (actor.looseness[v] < pinned) continue;
    if (c.labels[v] == kUpperClothes) roles[v] = ClothRole::knitted;
    if (c.labels[v] == kSkirtLabel && p.y() < BodyPlan::kWaist - kBand)
      roles[v] = field.skirt_depth(p) < kOuterFace ? ClothRole::woven : ClothRole::lining;
    if (c.labels[v] == kTrousers && actor.looseness[v] >= SkinPatch::kFirm) roles[v] = ClothRole::lining;
  }
  return roles;
}

std::vector<Points> drape_clothes(const Actor& actor, const std::vector<Points>& worn, const Motion& motion, double fps,
                                  const XpbdOptions& options) {
  check_input(worn, motion, fps, options);
  std::vector<Points> surfaces;
  if (worn.empty()) return surfaces;
  Drape drape(actor, worn, motion, fps, options);
  for (std::size_t f = 0; f < worn.size(); ++f) {
    if (stop_requested()) fail("simulating the clothes: stopped in frame {}", f);
    if (f > 0) drape.advance_frame(f - 1);
    surfaces.push_back(drape.surface(f));
  }
  return surfaces;
}

}  // namespace doppel::synth
