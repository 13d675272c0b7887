#pragma once

#include <Eigen/Core>
#include <array>

#include "doppel/geometry/distance_field.h"

namespace doppel::synth {

/// The body parts of the actor. The right limbs follow the left limbs in the same order.
enum Part : int {
  kTorso,
  kSkirt,
  kHead,
  kHair,
  kLeftArm,
  kLeftForearm,
  kLeftHand,
  kLeftThigh,
  kLeftShin,
  kLeftFoot,
  kRightArm,
  kRightForearm,
  kRightHand,
  kRightThigh,
  kRightShin,
  kRightFoot,
  kNumParts
};
constexpr int kLimbParts = kRightArm - kLeftArm;

/// The positions of the actor's joints in the rest pose (an A-pose, facing +z, feet on y = 0), metres. The left side
/// has x > 0; the right side is its mirror image.
struct BodyPlan {
  static Eigen::Vector3d root() { return {0, 0.95, 0}; }
  static Eigen::Vector3d neck() { return {0, 1.455, -0.012}; }
  static Eigen::Vector3d head_top() { return {0, 1.75, 0.0}; }
  static Eigen::Vector3d clavicle() { return {0.035, 1.405, -0.01}; }
  static Eigen::Vector3d shoulder() { return {0.166, 1.39, -0.012}; }
  static Eigen::Vector3d arm_direction() { return Eigen::Vector3d(0.72, -0.69, 0.04).normalized(); }
  static Eigen::Vector3d elbow() { return shoulder() + 0.275 * arm_direction(); }
  static Eigen::Vector3d wrist() { return elbow() + 0.245 * arm_direction(); }
  static Eigen::Vector3d fingertip() { return wrist() + 0.175 * arm_direction(); }
  static Eigen::Vector3d hip() { return {0.088, 0.91, 0}; }
  static Eigen::Vector3d knee() { return {0.1, 0.495, 0.012}; }
  static Eigen::Vector3d ankle() { return {0.107, 0.085, -0.025}; }
  static Eigen::Vector3d toe() { return {0.125, 0.03, 0.165}; }
  static constexpr double kWaist = 1.035, kHem = 0.50;  ///< heights of the upper and lower end of the skirt
};

/// The point or vector on the other side of the body.
inline Eigen::Vector3d mirrored(const Eigen::Vector3d& p) { return {-p.x(), p.y(), p.z()}; }

/// A line in a part, and a radius around it in which the part is.
struct PartAxis {
  Eigen::Vector3d from, to;
  double radius = 0;  ///< metres
};
/// Of the trunk, the limbs, hands and feet. @throws Error for head, hair and skirt
PartAxis part_axis(Part part);

/// The actor as a signed distance field: smooth unions of round cones, ellipsoids and a hollow, folded skirt. The
/// values are true distances only near the surface. This suffices for meshing and projection.
class BodyField {
 public:
  /// Distance to one part, metres, negative inside.
  double part_distance(Part part, const Eigen::Vector3d& p) const;
  /// Distances to the individual parts.
  std::array<double, kNumParts> part_distances(const Eigen::Vector3d& p) const;
  /// The smooth union of parts from the distances to them. A part at a distance of 1 m or more adds nothing.
  static double joined(const std::array<double, kNumParts>& part);
  /// Distance to the whole body.
  double distance(const Eigen::Vector3d& p) const;
  /// `distance` as a function that outlives this object.
  static DistanceField field();
  /// Gradient of `distance` by central differences.
  Eigen::Vector3d gradient(const Eigen::Vector3d& p) const;
  /// The part nearest to p.
  Part part(const Eigen::Vector3d& p) const;
  /// Horizontal depth of a point of the skirt below its outer face, metres. The inner wall is 0.034 deep.
  double skirt_depth(const Eigen::Vector3d& p) const;
  /// Unoccluded share of the surroundings of a surface point, 0..1, from the field along its normal.
  double openness(const Eigen::Vector3d& p, const Eigen::Vector3d& normal) const;
};

}  // namespace doppel::synth
