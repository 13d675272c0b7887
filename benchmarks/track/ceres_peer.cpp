#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "pose_frame.h"

namespace doppel::bench {
namespace {

constexpr int kUnknowns = 33;  // of the synthetic actor

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Matrix3 = Eigen::Matrix<T, 3, 3>;
template <typename T>
using Quaternion = Eigen::Quaternion<T>;

double number(double x) { return x; }
template <int n>
double number(const ceres::Jet<double, n>& x) {
  return x.a;
}

/// exp of a rotation vector.
template <typename T>
Matrix3<T> rotation_of(const Vector3<T>& turn) {
  T matrix[9];
  ceres::AngleAxisToRotationMatrix(turn.data(), matrix);
  return Eigen::Map<const Matrix3<T>>(matrix);
}

/// The energy of a frame as rows whose squares sum up to it. Its parameters are a step of the unknowns from the start.
class PoseFunctor {
 public:
  explicit PoseFunctor(const PoseFrame& frame)
      : frame_(frame),
        model_(*frame.model),
        skeleton_(model_.character().skeleton),
        start_(skeleton_.pose(frame.start)),
        targets_(frame.outline.size()) {
    const Character& character = model_.character();
    const auto rest = skeleton_.pose(character.rest_dofs);
    for (const int joint : character.bone_joint) rest_from_joint_.push_back(rest[at(joint)].inverse(Eigen::Isometry));
    if (model_.num_unknowns() != kUnknowns) fail("the functor is compiled for {} unknowns", kUnknowns);
  }

  int num_rows() const {
    int seen = 0;
    for (const Keypoint& keypoint : frame_.evidence[0].keypoints) seen += keypoint.confidence >= kSeenConfidence;
    return static_cast<int>(2 * seen + 3 * frame_.joints.size() + 3 * frame_.previous.size() + frame_.outline.size()) +
           3 * kUnknowns;
  }

  template <typename T>
  bool operator()(const T* step, T* rows) const {
    Body<T> body = pose(step);
    keypoints(body, rows);
    joints(body, rows);
    previous(body, rows);
    silhouette(body, rows);
    dof_rows(body, rows);
    return true;
  }

 private:
  template <typename T>
  struct DualQuaternion {
    Quaternion<T> real, dual;
  };
  template <typename T>
  struct Body {
    std::vector<T> dofs;
    std::vector<Matrix3<T>> turn;          ///< [J]
    std::vector<Vector3<T>> position;      ///< [J]
    std::vector<DualQuaternion<T>> bones;  ///< [Bn] world from rest
    std::vector<Vector3<T>> landmarks;
  };
  static std::size_t at(int index) { return as_size(index); }

  template <typename T>
  Body<T> pose(const T* step) const {
    Body<T> body;
    for (const double value : frame_.start) body.dofs.push_back(T(value));
    for (int u = 0; u < kUnknowns; ++u)
      if (const auto dof = model_.dof_of(u)) body.dofs[at(*dof)] += step[u];
    const Vector3<T> turn = Eigen::Map<const Vector3<T>>(step + kUnknowns - 3);
    std::vector<T> q(skeleton_.joints.size(), T(0));
    for (std::size_t d = 0; d < body.dofs.size(); ++d)
      for (const Dof::Drive& drive : skeleton_.dofs[d].joints) q[at(drive.joint)] += drive.weight * body.dofs[d];
    for (int j = 0; j < skeleton_.num_joints(); ++j) add_joint(j, q[at(j)], turn, body);
    for (std::size_t b = 0; b < rest_from_joint_.size(); ++b) body.bones.push_back(bone(b, body));
    for (const Marker& marker : model_.landmarks())
      body.landmarks.push_back(body.turn[at(marker.joint)] * marker.position.cast<T>() +
                               body.position[at(marker.joint)]);
    return body;
  }

  template <typename T>
  void add_joint(int j, const T& q, const Vector3<T>& turn, Body<T>& body) const {
    const Joint& joint = skeleton_.joints[at(j)];
    const bool free = joint.parent < 0;
    Matrix3<T> rotation = free ? Matrix3<T>(Matrix3<T>::Identity()) : body.turn[at(joint.parent)];
    Vector3<T> position = free ? Vector3<T>(joint.offset.cast<T>())
                               : Vector3<T>(rotation * joint.offset.cast<T>() + body.position[at(joint.parent)]);
    if (joint.type == Joint::Type::prismatic) {
      position += rotation * Vector3<T>(joint.axis.cast<T>() * q);
    } else if (j == model_.root()->joint()) {
      rotation = rotation_of(turn) * start_[at(j)].linear().cast<T>();
    } else {
      rotation = Matrix3<T>(rotation * rotation_of(Vector3<T>(joint.axis.cast<T>() * q)));
    }
    body.turn.push_back(rotation);
    body.position.push_back(position);
  }

  template <typename T>
  DualQuaternion<T> bone(std::size_t b, const Body<T>& body) const {
    const std::size_t j = at(model_.character().bone_joint[b]);
    const Matrix3<T> rotation = body.turn[j] * rest_from_joint_[b].linear().cast<T>();
    const Vector3<T> t = body.turn[j] * Vector3<T>(rest_from_joint_[b].translation().cast<T>()) + body.position[j];
    T wxyz[4];
    ceres::RotationMatrixToQuaternion(rotation.data(), wxyz);
    const Quaternion<T> real(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
    Quaternion<T> dual = Quaternion<T>(T(0), t.x(), t.y(), t.z()) * real;
    dual.coeffs() *= T(0.5);
    return {real, dual};
  }

  template <typename T>
  Vector3<T> vertex(const Body<T>& body, int vertex, Vector3<double>& normal) const {
    const Character& character = model_.character();
    const IndexRows& rows = character.skin.vertex_bones;
    const std::span<const double> weights = rows.row_of(character.skin.weights, vertex);
    const DualQuaternion<T>& first = body.bones[at(rows.row(vertex)[0])];
    Quaternion<T> real(T(0), T(0), T(0), T(0)), dual(T(0), T(0), T(0), T(0));
    for (int i = 0; i < rows.size(vertex); ++i) {
      const DualQuaternion<T>& bone = body.bones[at(rows.row(vertex)[at(i)])];
      double cosine = 0.0;
      for (int k = 0; k < 4; ++k) cosine += number(first.real.coeffs()[k]) * number(bone.real.coeffs()[k]);
      const double weight = cosine < 0.0 ? -weights[at(i)] : weights[at(i)];
      for (int k = 0; k < 4; ++k) {
        real.coeffs()[k] += weight * bone.real.coeffs()[k];
        dual.coeffs()[k] += weight * bone.dual.coeffs()[k];
      }
    }
    const Vector3<T> rest = character.mesh.vertices[at(vertex)].template cast<T>(), v = real.vec();
    const T scale = T(2) / real.squaredNorm();
    const Vector3<T> cross = v.cross(rest);
    const Eigen::Quaterniond turn(number(real.w()), number(real.x()), number(real.y()), number(real.z()));
    normal = turn.normalized() * model_.rest_normal(vertex);
    return rest + scale * (real.w() * cross + v.cross(cross) + Vector3<T>((dual * real.conjugate()).vec()));
  }

  template <typename T>
  Eigen::Matrix<T, 2, 1> project(const Vector3<T>& point) const {
    const PinholeCamera& camera = frame_.cameras[0];
    const Vector3<T> x = camera.K.cast<T>() * Vector3<T>(camera.R.cast<T>() * point + camera.t.cast<T>());
    return {x.x() / x.z(), x.y() / x.z()};
  }

  /// Scales a group of rows so that the sum of their squares is weight * scale^2 s / (scale^2 + s).
  template <typename T>
  static void finish(T*& rows, int count, double weight, double kernel) {
    T s(0);
    for (int i = 0; i < count; ++i) s += rows[i] * rows[i];
    const T factor = kernel * std::sqrt(weight) / sqrt(kernel * kernel + s);
    for (int i = 0; i < count; ++i) *rows++ *= factor;
  }
  template <typename T>
  static void write(T*& rows, const Vector3<T>& difference, double weight) {
    for (int i = 0; i < 3; ++i) *rows++ = std::sqrt(weight) * difference[i];
  }

  template <typename T>
  void keypoints(const Body<T>& body, T*& rows) const {
    const double weight = frame_.options.keypoint_weight;
    const double scale = reference_pixels(frame_.cameras[0]);
    for (std::size_t m = 0; m < body.landmarks.size(); ++m) {
      const Keypoint& keypoint = frame_.evidence[0].keypoints[m];
      if (keypoint.confidence < kSeenConfidence) continue;
      const Eigen::Matrix<T, 2, 1> pixel = project(body.landmarks[m]);
      rows[0] = scale * (pixel.x() - static_cast<double>(keypoint.x));
      rows[1] = scale * (pixel.y() - static_cast<double>(keypoint.y));
      finish(rows, 2, weight * frame_.landmark_weights[m] * keypoint.confidence, frame_.options.keypoint_scale);
    }
  }

  template <typename T>
  void joints(const Body<T>& body, T*& rows) const {
    Vector3<T> shift = Vector3<T>::Zero();
    const double share = 1.0 / static_cast<double>(frame_.joints.size());
    for (const auto& target : frame_.joints)
      shift += T(share) * (body.landmarks[at(target.landmark)] - target.point.cast<T>());
    for (const auto& target : frame_.joints)
      write(rows, Vector3<T>(body.landmarks[at(target.landmark)] - target.point.cast<T>() - shift),
            frame_.options.joint_weight * target.weight);
  }

  template <typename T>
  void previous(const Body<T>& body, T*& rows) const {
    for (const auto& target : frame_.previous)
      write(rows, Vector3<T>(body.landmarks[at(target.landmark)] - target.point.cast<T>()),
            frame_.options.temporal_weight * target.weight);
  }

  /// As in our term, each computation of jacobians chooses anew the vertices that belong to the opposite outline.
  template <typename T>
  void silhouette(const Body<T>& body, T*& rows) const {
    const double scale = reference_pixels(frame_.cameras[0]);
    for (std::size_t i = 0; i < frame_.outline.size(); ++i) {
      Eigen::Vector3d normal;
      const Vector3<T> point = vertex(body, frame_.outline[i].vertex, normal);
      const Eigen::Matrix<T, 2, 1> pixel = project(point);
      const Eigen::Vector2d here(number(pixel.x()), number(pixel.y()));
      const OutlineField::Sample sample = frame_.evidence[0].outline.at(here);
      const T distance =
          sample.distance + sample.gradient.x() * (pixel.x() - here.x()) + sample.gradient.y() * (pixel.y() - here.y());
      if constexpr (!std::is_same_v<T, double>) {
        const Eigen::Vector3d where(number(point.x()), number(point.y()), number(point.z()));
        targets_[i] = frame_.outline[i].distance;
        if (belongs_to_opposite_outline(*project_with_jacobian(frame_.cameras[0], where), normal, sample))
          targets_[i] = 2.0 * scale * sample.distance - targets_[i];
      }
      rows[0] = scale * distance - targets_[i];
      finish(rows, 1, frame_.options.silhouette_weight, frame_.options.silhouette_scale);
    }
  }

  /// Limits, the rest pose, and where the last frames lead.
  template <typename T>
  void dof_rows(const Body<T>& body, T*& rows) const {
    const LivecapOptions& o = frame_.options;
    for (int u = 0; u < kUnknowns; ++u, rows += 3) {
      rows[0] = rows[1] = rows[2] = T(0);
      const auto dof = model_.dof_of(u);
      if (!dof) continue;
      const T& value = body.dofs[at(*dof)];
      const double reach = model_.reach(*dof);
      if (const auto& limits = skeleton_.dofs[at(*dof)].limits)
        rows[0] = std::sqrt(o.limit_weight) * reach *
                  (value < (*limits)[0]   ? T(value - (*limits)[0])
                   : value > (*limits)[1] ? T(value - (*limits)[1])
                                          : T(0));
      if (model_.moves_root(*dof)) continue;
      rows[1] = std::sqrt(o.prior_weight) * reach * (value - model_.character().rest_dofs[at(*dof)]);
      rows[2] = std::sqrt(o.steady_weight) * reach * (value - frame_.expected[at(*dof)]);
    }
  }

  const PoseFrame& frame_;
  const PoseModel& model_;
  const Skeleton& skeleton_;
  std::vector<Eigen::Affine3d> start_, rest_from_joint_;
  mutable std::vector<double> targets_;
};

/// Ceres halves the sum of squares.
class StopAt : public ceres::IterationCallback {
 public:
  explicit StopAt(double wanted) : wanted_(wanted) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    return 2.0 * summary.cost <= wanted_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  double wanted_;
};

ceres::CostFunction* cost_function(const PoseFrame& frame) {
  auto* functor = new PoseFunctor(frame);
  return new ceres::AutoDiffCostFunction<PoseFunctor, ceres::DYNAMIC, kUnknowns>(functor, functor->num_rows());
}

}  // namespace

double ceres_start_cost(const PoseFrame& frame) {
  double step[kUnknowns] = {};
  ceres::Problem problem;
  problem.AddResidualBlock(cost_function(frame), nullptr, step);
  double cost = 0.0;
  std::vector<double> gradient;
  problem.Evaluate({}, &cost, nullptr, &gradient, nullptr);
  return 2.0 * cost;
}

PoseSolution solve_with_ceres(const PoseFrame& frame, double wanted, int most_steps) {
  double step[kUnknowns] = {};
  ceres::Problem problem;
  problem.AddResidualBlock(cost_function(frame), nullptr, step);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = most_steps;
  options.initial_trust_region_radius = 1.0 / frame.options.solver.initial_damping;
  options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 0.0;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  StopAt stop(wanted);
  options.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  const Eigen::Map<const Eigen::VectorXd> found(step, kUnknowns);
  return {frame.model->moved(frame.start, found), static_cast<int>(summary.iterations.size()) - 1};
}

}  // namespace doppel::bench
