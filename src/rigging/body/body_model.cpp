#include "doppel/rigging/body/body_model.h"

#include "doppel/rigging/body/body_cover.h"
#include "doppel/rigging/body/girth_solver.h"
#include "doppel/rigging/body/proportions.h"
#include "doppel/rigging/body/reference_body.h"
#include "doppel/rigging/joints/body_skeleton.h"

namespace doppel {

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
