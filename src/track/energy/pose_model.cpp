#include "doppel/track/energy/pose_model.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "doppel/character/landmarks.h"
#include "doppel/character/pose_solver.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/track/energy/landmark_weight.h"

namespace doppel {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kMinSquaredNorm = 1e-12;  // of a blended real part

PosedBody::DualQuaternion dual_quaternion(const Eigen::Affine3d& transform) {
  const Quaterniond real(Matrix3d(transform.linear()));
  const Vector3d t = transform.translation();
  Quaterniond dual = Quaterniond(0.0, t.x(), t.y(), t.z()) * real;
  dual.coeffs() *= 0.5;
  return {real, dual};
}

}  // namespace

double PoseModel::SkinnedVertex::signed_weight(const PosedBody& body, std::size_t i) const {
  const auto& first = body.world_from_rest[bones[0]].real;
  return first.dot(body.world_from_rest[bones[i]].real) < 0.0 ? -weights[i] : weights[i];
}

PoseModel::PoseModel(const Character& character, std::vector<Marker> landmarks, const std::vector<int>& dofs)
    : character_(character), landmarks_(std::move(landmarks)), root_(RootRotation::of(character.skeleton)) {
  const Skeleton& skeleton = character.skeleton;
  std::vector<int> turns;
  if (root_)
    for (const int dof : root_->root().rotation)
      if (std::find(dofs.begin(), dofs.end(), dof) != dofs.end()) turns.push_back(dof);
  if (turns.size() != 3) root_.reset();
  for (const int dof : dofs) {
    if (dof < 0 || dof >= skeleton.num_dofs())
      fail("there is no DoF {}; the skeleton has {}", dof, skeleton.num_dofs());
    if (!root_ || std::find(turns.begin(), turns.end(), dof) == turns.end()) unknowns_.push_back({dof, -1});
  }
  for (int axis = 0; root_ && axis < 3; ++axis) unknowns_.push_back({-1, axis});
  for (int d = 0; d < skeleton.num_dofs(); ++d) reach_.push_back(reach_of_dof(skeleton, d));
  for (const Marker& landmark : landmarks_) landmark_carrier_.push_back(carrier_of(landmark.joint));
  landmark_weights_ = landmark_fit_weights(landmark_names(landmarks_));
  const std::vector<Eigen::Affine3d> rest = skeleton.pose(character.rest_dofs);
  for (const int joint : character.bone_joint) {
    bone_carrier_.push_back(carrier_of(joint));
    joint_from_rest_.push_back(rest[joint].inverse(Eigen::Isometry));
  }
  rest_vertices_ = character.mesh.vertices;
  rest_normals_ = vertex_normals(character.mesh);
  find_root_dofs();
}

/// A DoF moves the root when one of its joints lies above all carriers.
void PoseModel::find_root_dofs() {
  std::vector<std::size_t> carried(character_.skeleton.joints.size(), 0);
  for (const int carrier : carrier_joint_)
    for (int j = carrier; j >= 0; j = character_.skeleton.joints[j].parent) ++carried[j];
  for (const Dof& dof : character_.skeleton.dofs)
    moves_root_.push_back(std::any_of(dof.joints.begin(), dof.joints.end(), [&](const Dof::Drive& drive) {
      return carried[drive.joint] == carrier_joint_.size();
    }));
}

/// The index of a joint among the carriers. A new carrier collects the unknowns that move it.
int PoseModel::carrier_of(int joint) {
  const auto found = std::find(carrier_joint_.begin(), carrier_joint_.end(), joint);
  if (found != carrier_joint_.end()) return static_cast<int>(found - carrier_joint_.begin());
  std::vector<Handle> handles;
  bool turned = false;
  for (int j = joint; j >= 0; j = character_.skeleton.joints[j].parent) {
    turned = turned || (root_ && j == root_->joint());
    for (int u = 0; u < num_unknowns(); ++u) {
      const Unknown& unknown = unknowns_[u];
      if (unknown.dof < 0) continue;
      for (const Dof::Drive& drive : character_.skeleton.dofs[unknown.dof].joints)
        if (drive.joint == j && drive.weight != 0.0) handles.push_back({j, u, drive.weight});
    }
  }
  std::set<int> movers;
  for (const Handle& handle : handles) movers.insert(handle.unknown);
  for (int axis = 1; turned && axis <= 3; ++axis) movers.insert(num_unknowns() - axis);
  movers_.emplace_back(movers.begin(), movers.end());
  carrier_joint_.push_back(joint);
  handles_.push_back(std::move(handles));
  turned_.push_back(turned);
  return static_cast<int>(carrier_joint_.size()) - 1;
}

std::string PoseModel::unknown_name(int unknown) const {
  const Unknown& found = unknowns_.at(as_size(unknown));
  if (found.dof >= 0) return character_.skeleton.dofs[found.dof].name;
  return std::string("root turn ") + "xyz"[found.root_axis];
}

std::optional<int> PoseModel::dof_of(int unknown) const {
  const int dof = unknowns_.at(as_size(unknown)).dof;
  return dof < 0 ? std::nullopt : std::optional(dof);
}

PosedBody PoseModel::pose(const std::vector<double>& dofs, bool jacobian) const {
  PosedBody body;
  body.dofs = dofs;
  body.world_from_joint = character_.skeleton.pose(dofs);
  body.world_from_rest.reserve(bone_carrier_.size());
  for (std::size_t b = 0; b < bone_carrier_.size(); ++b) {
    const auto joint = as_size(character_.bone_joint[b]);
    body.world_from_rest.push_back(dual_quaternion(body.world_from_joint[joint] * joint_from_rest_[b]));
  }
  if (jacobian) add_twists(body);
  return body;
}

/// A joint that rotates about `axis` through `origin` moves the point at the world's origin by axis x (0 - origin).
void PoseModel::add_twists(PosedBody& body) const {
  body.twists.resize(carrier_joint_.size());
  for (std::size_t c = 0; c < carrier_joint_.size(); ++c) {
    PosedBody::Twists& twists = body.twists[c];
    twists.setZero(6, num_unknowns());
    for (const Handle& handle : handles_[c]) {
      const auto j = as_size(handle.joint);
      const Joint& joint = character_.skeleton.joints[j];
      const Eigen::Affine3d& world = body.world_from_joint[j];
      const Vector3d axis = handle.weight * (world.linear() * joint.axis);
      if (joint.type == Joint::Type::prismatic) {
        twists.col(handle.unknown).tail<3>() += axis;
      } else {
        twists.col(handle.unknown).head<3>() += axis;
        twists.col(handle.unknown).tail<3>() -= axis.cross(world.translation());
      }
    }
    if (!turned_[c]) continue;
    const Vector3d origin = body.world_from_joint[root_->joint()].translation();
    for (int axis = 0; axis < 3; ++axis) {
      const int unknown = num_unknowns() - 3 + axis;
      twists.col(unknown).head<3>() = Vector3d::Unit(axis);
      twists.col(unknown).tail<3>() = -Vector3d::Unit(axis).cross(origin);
    }
  }
}

std::vector<double> PoseModel::moved(const std::vector<double>& dofs, const Eigen::VectorXd& step) const {
  std::vector<double> result = dofs;
  Vector3d turn = Vector3d::Zero();
  for (int u = 0; u < num_unknowns(); ++u) {
    const Unknown& unknown = unknowns_[u];
    if (unknown.dof >= 0)
      result[unknown.dof] += step[u];
    else
      turn[unknown.root_axis] = step[u];
  }
  if (root_) root_->set_matrix(result, rotation_of_vector(turn) * root_->matrix(dofs));
  return result;
}

Eigen::VectorXd PoseModel::step_between(const std::vector<double>& from, const std::vector<double>& to) const {
  Eigen::VectorXd step(num_unknowns());
  const Vector3d turn =
      root_ ? vector_of_rotation(root_->matrix(to) * root_->matrix(from).transpose()) : Vector3d(Vector3d::Zero());
  for (int u = 0; u < num_unknowns(); ++u) {
    const Unknown& unknown = unknowns_[u];
    step[u] = unknown.dof >= 0 ? to[unknown.dof] - from[unknown.dof] : turn[unknown.root_axis];
  }
  return step;
}

Vector3d PoseModel::landmark(const PosedBody& body, int landmark) const {
  const Marker& marker = landmarks_[landmark];
  return body.world_from_joint[marker.joint] * marker.position;
}

/// Adds force^T times the twist of the carrier for each unknown.
void PoseModel::add_force(const PosedBody& body, std::size_t carrier, const Eigen::Matrix<double, 6, 1>& force,
                          Row row) const {
  for (const int unknown : movers_[carrier]) row[unknown] += force.dot(body.twists[carrier].col(unknown));
}

void PoseModel::add_landmark_jacobian(const PosedBody& body, int landmark, const Vector3d& gradient,
                                      const Row& row) const {
  Eigen::Matrix<double, 6, 1> force;
  force << this->landmark(body, landmark).cross(gradient), gradient;
  const auto carrier = as_size(landmark_carrier_[landmark]);
  add_force(body, carrier, force, row);
}

PoseModel::SkinnedVertex PoseModel::skinned(const PosedBody& body, int vertex) const {
  const IndexRows& rows = character_.skin.vertex_bones;
  SkinnedVertex result;
  result.vertex = vertex;
  result.bones = rows.row(vertex);
  result.weights = rows.row_of(character_.skin.weights, vertex);
  for (std::size_t i = 0; i < result.bones.size(); ++i) {
    const auto& bone = body.world_from_rest[result.bones[i]];
    const double weight = result.signed_weight(body, i);
    result.real.coeffs() += weight * bone.real.coeffs();
    result.dual.coeffs() += weight * bone.dual.coeffs();
  }
  result.squared_norm = std::max(result.real.squaredNorm(), kMinSquaredNorm);
  const Vector3d rest = rest_vertices_[vertex];
  const Vector3d v = result.real.vec();
  const double w = result.real.w();
  const Vector3d cross = v.cross(rest);
  result.turned = rest + 2.0 / result.squared_norm * (w * cross + v.cross(cross));
  result.translation = 2.0 / result.squared_norm * (result.dual * result.real.conjugate()).vec();
  if (character_.skinning == SkinningMode::linear) {
    result.translation = -result.turned;
    for (std::size_t i = 0; i < result.bones.size(); ++i)
      result.translation += result.weights[i] * moved_by_bone(body, result.bones[i], vertex);
  }
  return result;
}

/// The rest position, moved rigidly with one bone.
Vector3d PoseModel::moved_by_bone(const PosedBody& body, int bone, int vertex) const {
  const auto b = as_size(bone);
  const auto joint = as_size(character_.bone_joint[b]);
  return body.world_from_joint[joint] * (joint_from_rest_[b] * rest_vertices_[vertex]);
}

Vector3d PoseModel::vertex(const PosedBody& body, int vertex) const { return skinned(body, vertex).position(); }

Eigen::Affine3d PoseModel::movement(const PosedBody& body, int vertex) const {
  const SkinnedVertex blended = skinned(body, vertex);
  return Eigen::Translation3d(blended.translation) * blended.real.normalized();
}

Vector3d PoseModel::normal(const SkinnedVertex& vertex) const {
  return vertex.real.normalized() * rest_normals_[vertex.vertex];
}

/// With the blend r + eps d of the bones c_b (r_b + eps d_b), a vertex is x = y + t, y = r v r* / |r|^2 and
/// t = vec(e), e = 2 d r* / |r|^2. A bone's twist (omega, u) changes it by
///   dr_b = 1/2 omega r_b,  dd_b = 1/2 (omega d_b + u r_b),
///   dx = tau_v x (2 y + t) + vec(omega h + u a) - e_s tau_v - tau_s t,   tau = 1/2 omega a,
/// with a = c_b r_b r* / |r|^2 and h = c_b d_b r* / |r|^2 (s: scalar part, v: vector part). The rows below are
/// gradient^T dx, sorted by omega and u. With linear skinning, dx = w_b (omega x x_b + u).
void PoseModel::add_vertex_jacobian(const PosedBody& body, const SkinnedVertex& blended, const Vector3d& gradient,
                                    const Row& row) const {
  if (character_.skinning == SkinningMode::linear) {
    for (std::size_t i = 0; i < blended.bones.size(); ++i) {
      Eigen::Matrix<double, 6, 1> force;
      force << moved_by_bone(body, blended.bones[i], blended.vertex).cross(gradient), gradient;
      add_force(body, as_size(bone_carrier_[blended.bones[i]]), blended.weights[i] * force, row);
    }
    return;
  }
  Quaterniond conjugate = blended.real.conjugate();
  conjugate.coeffs() /= blended.squared_norm;
  const double e_scalar = 2.0 * (blended.dual * conjugate).w();
  const Vector3d m = (2.0 * blended.turned + blended.translation).cross(gradient) - e_scalar * gradient;
  const double along = blended.translation.dot(gradient);
  for (std::size_t i = 0; i < blended.bones.size(); ++i) {
    const auto bone = as_size(blended.bones[i]);
    const double weight = blended.signed_weight(body, i);
    Quaterniond a = body.world_from_rest[bone].real * conjugate, h = body.world_from_rest[bone].dual * conjugate;
    a.coeffs() *= weight;
    h.coeffs() *= weight;
    Eigen::Matrix<double, 6, 1> force;
    force << 0.5 * (a.w() * m + a.vec().cross(m) + along * a.vec()) + h.w() * gradient + h.vec().cross(gradient),
        a.w() * gradient + a.vec().cross(gradient);
    add_force(body, as_size(bone_carrier_[bone]), force, row);
  }
}

}  // namespace doppel
