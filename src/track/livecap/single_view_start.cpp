#include "doppel/track/livecap/single_view_start.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "doppel/track/energy/alignment.h"

namespace doppel {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Points = std::vector<std::optional<Vector3d>>;

constexpr int kMinStartPoints = 4;
constexpr double kNearest = 0.3;  // metres: smallest distance of a body from the camera
constexpr int kSides = 4;

Points landmarks_of(const PoseModel& model, const std::vector<double>& dofs) {
  const PosedBody body = model.pose(dofs, false);
  Points points;
  for (int m = 0; m < model.num_landmarks(); ++m) points.emplace_back(model.landmark(body, m));
  return points;
}

}  // namespace

std::optional<Vector3d> shift_onto_rays(const PinholeCamera& camera, const std::vector<Keypoint>& keypoints,
                                        const Points& points) {
  const Vector3d centre = camera.centre();
  const Matrix3d ray_of_pixel = camera.R.transpose() * camera.K.inverse();
  Matrix3d normal = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero(), mean = Vector3d::Zero();
  int count = 0;
  for (std::size_t m = 0; m < points.size(); ++m) {
    if (!points[m] || !(keypoints[m].confidence >= kSeenConfidence)) continue;
    const Vector3d ray = (ray_of_pixel * Vector3d(keypoints[m].x, keypoints[m].y, 1.0)).normalized();
    const Matrix3d across = keypoints[m].confidence * (Matrix3d::Identity() - ray * ray.transpose());
    normal += across;
    right += across * (centre - *points[m]);
    mean += *points[m];
    ++count;
  }
  if (count < kMinStartPoints) return std::nullopt;
  const Eigen::LDLT<Matrix3d> factor(normal);
  if (!(factor.vectorD().minCoeff() > 1e-9 * normal.trace())) return std::nullopt;
  const Vector3d shift = factor.solve(right);
  if (!shift.allFinite() || !(camera.camera_from_world(mean / count + shift).z() > kNearest)) return std::nullopt;
  return shift;
}

std::vector<std::vector<double>> single_view_starts(const PoseModel& model, const PinholeCamera& camera,
                                                    const std::vector<Keypoint>& keypoints, const Points& joints,
                                                    const std::vector<double>& rigidity,
                                                    const std::vector<double>& rest) {
  std::vector<std::vector<double>> starts;
  if (!model.root()) return starts;
  const RootRotation& root = *model.root();
  if (const auto shift = shift_onto_rays(camera, keypoints, joints)) {
    std::vector<std::optional<TriangulatedPoint>> points(joints.size());
    for (std::size_t m = 0; m < joints.size(); ++m)
      if (joints[m]) points[m] = TriangulatedPoint{*joints[m] + *shift, 1, 0.0, {}};
    if (auto start = align_root(model, rest, points, rigidity)) starts.push_back(std::move(*start));
  }
  if (!starts.empty()) return starts;
  for (int side = 0; side < kSides; ++side) {
    std::vector<double> start = rest;
    const Eigen::AngleAxisd turn(2.0 * M_PI * side / kSides, Vector3d::UnitY());
    root.set_matrix(start, turn * root.matrix(rest));
    const auto shift = shift_onto_rays(camera, keypoints, landmarks_of(model, start));
    if (!shift) break;
    root.set_position(start, root.position(start) + *shift);
    starts.push_back(std::move(start));
  }
  return starts;
}

}  // namespace doppel
