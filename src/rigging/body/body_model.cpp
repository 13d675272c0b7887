#include "doppel/rigging/body/body_model.h"

#include <cmath>

#include "doppel/geometry/distance_field.h"
#include "doppel/geometry/smooth_values.h"
#include "doppel/rigging/body/girth_solver.h"
#include "doppel/rigging/body/proportions.h"
#include "doppel/rigging/body/reference_body.h"
#include "doppel/rigging/joints/body_skeleton.h"

namespace doppel {

using Eigen::Vector3d;

/// Hair and loose clothes as displacements of the surface: a vertex moves along its direction by a share of the hair's
/// volume, of the looseness of the top, and of the looseness of the trousers.
struct BodyCover {
  std::vector<Eigen::Vector3d> outward;     ///< [N] unit, smooth over the surface
  std::vector<double> hair, top, trousers;  ///< [N] shares, 0..1, smooth over the surface
};

namespace {

/// Position along a bone: 0 at its first joint, 1 at its second.
double along(const Vector3d& p, const Vector3d& from, const Vector3d& to) {
  return (p - from).dot(to - from) / (to - from).squaredNorm();
}

/// 1 under the hair: above a plane from the forehead to the nape, without the ears.
double hair_share(const Vector3d& p, const BodyJoints& joints) {
  const Vector3d middle = 0.5 * (joints.at("left_ear") + joints.at("right_ear"));
  const double head = (joints.at("head_top") - middle).norm();  // about 0.12 m
  const Vector3d q = (p - middle) / head;
  const double face = Vector3d(0, -0.66, 0.75).dot(q - Vector3d(0, 0.48, 0.52));
  const double ear = (Vector3d(std::abs(q.x()), q.y(), q.z()) - (joints.at("left_ear") - middle) / head).norm();
  return (1 - smooth_step(-0.40, 0.10, face)) * smooth_step(-0.75, -0.35, q.y()) * smooth_step(0.22, 0.42, ear);
}

/// The shares of top and trousers in a vertex of trunk or limbs.
struct ClothShares {
  double top = 0, trousers = 0;
};

ClothShares cloth_shares(const Vector3d& p, const SegmentWeights& w, const BodyJoints& joints) {
  const Vector3d hips = 0.5 * (joints.at("left_hip") + joints.at("right_hip"));
  const double trunk = along(p, hips, joints.at("neck")), upper = smooth_step(-0.04, 0.10, trunk);
  ClothShares shares;
  shares.top = w[kTrunkSegment] * upper * (1 - smooth_step(0.90, 1.0, trunk));
  shares.trousers = w[kTrunkSegment] * (1 - upper);
  for (const int side : {0, kSideSegments}) {
    const std::string name = side == 0 ? "left_" : "right_";
    const double forearm = along(p, joints.at(name + "elbow"), joints.at(name + "wrist"));
    const double shin = along(p, joints.at(name + "knee"), joints.at(name + "ankle"));
    shares.top += w[kLeftArmSegment + side] + w[kLeftForearmSegment + side] * (1 - smooth_step(0.82, 0.95, forearm));
    shares.trousers += w[kLeftThighSegment + side] + w[kLeftShinSegment + side] * (1 - smooth_step(0.78, 0.92, shin));
    // In the folds of armpit and groin, clothes have no room.
    const double fold = 1 - 2 * w[kTrunkSegment] * w[kLeftArmSegment + side];
    shares.top *= fold * fold;
  }
  // Between the legs, too.
  const double thighs = w[kLeftThighSegment] + w[kRightThighSegment] + w[kTrunkSegment] * (1 - upper);
  const double apart = smooth_step(0.02, 0.09, std::abs(p.x()));
  shares.trousers *= 1 - thighs * (1 - apart);
  return shares;
}

/// The cover of a mesh in the rest pose.
/// @param weights [N] @param joints completed
BodyCover make_body_cover(const TriangleMesh& mesh, const std::vector<SegmentWeights>& weights,
                          const BodyJoints& joints) {
  constexpr int kRounds = 4;
  const MeshTopology topology(mesh);
  BodyCover cover;
  cover.outward = vertex_normals(mesh);
  smooth_values(cover.outward, topology, kRounds);
  for (Vector3d& direction : cover.outward) direction.normalize();
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    const Vector3d& p = mesh.vertices[v];
    cover.hair.push_back(weights[v][kHeadSegment] * hair_share(p, joints));
    const ClothShares shares = cloth_shares(p, weights[v], joints);
    cover.top.push_back(shares.top);
    cover.trousers.push_back(shares.trousers);
  }
  for (std::vector<double>* shares : {&cover.hair, &cover.top, &cover.trousers}) smooth_values(*shares, topology, 2);
  return cover;
}

}  // namespace

struct BodyModel::Data {
  /// Smoothing of the segment weights. More rounds give longer transitions at the joints.
  static constexpr int kRounds = 6;

  explicit Data(ReferenceBody body)
      : reference(std::move(body.character)),
        weights(segment_weights(reference.mesh, reference.skin, body.joints, kRounds)),
        cover(make_body_cover(reference.mesh, weights, body.joints)),
        warp(body.joints),
        solver(reference.mesh, weights, warp) {}
  Data(const Data&) = delete;
  Data& operator=(const Data&) = delete;

  BodyJoints joints(std::span<const double> measures) const {
    // Corrections of girths move no joint.
    return warp.map(proportional_factors(measures, solver.reference())).joints();
  }

  Character reference;
  std::vector<SegmentWeights> weights;
  BodyCover cover;
  BodyWarp warp;
  GirthSolver solver;
};

BodyModel::BodyModel(int num_vertices, int num_nodes)
    : data_(std::make_unique<const Data>(make_reference_body(num_vertices, num_nodes))) {}
BodyModel::~BodyModel() = default;
BodyModel::BodyModel(BodyModel&&) noexcept = default;
BodyModel& BodyModel::operator=(BodyModel&&) noexcept = default;

int BodyModel::num_vertices() const { return data_->reference.num_vertices(); }

std::vector<Eigen::Vector3d> BodyModel::vertices(std::span<const double> measures) const {
  check_measures(measures);
  const double hair = measures[measure_index("hair_volume")], top = measures[measure_index("top_looseness")],
               trousers = measures[measure_index("trousers_looseness")];
  const BodyWarp::Map map = data_->warp.map(data_->solver.factors(measures));
  const std::vector<Eigen::Vector3d>& from = data_->reference.mesh.vertices;
  const BodyCover& cover = data_->cover;
  std::vector<Eigen::Vector3d> vertices(from.size());
  for (std::size_t v = 0; v < from.size(); ++v)
    vertices[v] = map.point(from[v], data_->weights[v]) +
                  (hair * cover.hair[v] + top * cover.top[v] + trousers * cover.trousers[v]) * cover.outward[v];
  return vertices;
}

BodyJoints BodyModel::joints(std::span<const double> measures) const {
  check_measures(measures);
  return data_->joints(measures);
}

Character BodyModel::character(const std::string& name, std::span<const double> measures) const {
  Character character = data_->reference;
  character.name = name;
  character.mesh.vertices = vertices(measures);
  const BodyJoints joints = data_->joints(measures);
  BodySkeleton body = make_body_skeleton(joints);
  add_body_markers(body, joints, character.mesh);
  character.skeleton = std::move(body.skeleton);
  character.rest_dofs = std::move(body.rest_dofs);
  return character;
}

}  // namespace doppel
