#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "doppel/character/skinning_weights.h"
#include "doppel/geometry/mesh.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {

/// How many times larger a body is than a reference body: lengths along bones, distances between joints, and extents
/// across trunk and limbs at certain levels. 1 everywhere is the reference itself.
enum Factor : int {
  kTrunkLength,  ///< middle of the hips to the neck
  kNeckLength,
  kHeadHeight,
  kUpperArmLength,
  kForearmLength,
  kHandLength,
  kThighLength,
  kShinLength,
  kFootLength,
  kAnkleHeight,
  kShoulderJoints,  ///< distance between the shoulder joints
  kHipJoints,       ///< distance between the hip joints
  kHandBreadth,
  kFootBreadth,
  kHeadBreadth,
  kHeadDepth,
  kNeckGirth,
  kChestBreadth,
  kChestDepth,
  kWaistBreadth,
  kWaistDepth,
  kHipGirth,
  kUpperArmGirth,
  kForearmGirth,
  kWristGirth,
  kThighGirth,
  kKneeGirth,
  kCalfGirth,
  kAnkleGirth,
  kNumFactors
};
using BodyFactors = std::array<double, kNumFactors>;

/// The parts of a body that are scaled along and across their own axes.
enum Segment : int {
  kTrunkSegment,
  kNeckSegment,
  kHeadSegment,
  kLeftArmSegment,
  kLeftForearmSegment,
  kLeftHandSegment,
  kLeftThighSegment,
  kLeftShinSegment,
  kLeftFootSegment,
  kRightArmSegment,
  kRightForearmSegment,
  kRightHandSegment,
  kRightThighSegment,
  kRightShinSegment,
  kRightFootSegment,
  kNumSegments
};
inline constexpr int kSideSegments =
    kRightArmSegment - kLeftArmSegment;  ///< from a segment on the left to the same on the right

/// The shares of the segments in a point of the body; they sum to 1.
using SegmentWeights = Eigen::Matrix<double, kNumSegments, 1>;

/// The segment weights of the vertices of a character [N]: its skinning weights, added up over the bones of a segment
/// and smoothed over the surface. A skeleton without the bones `Neck` or `LeftHand` is served as well: the bone before
/// is then divided at the joint.
/// @param joints completed, in the pose of the mesh
/// @param rounds of smoothing, 0 or more
/// @throws Error for a bone that no segment knows
std::vector<SegmentWeights> segment_weights(const TriangleMesh& mesh, const SkinningWeights& skin,
                                            const BodyJoints& joints, int rounds);

/// Heights on the trunk, from the middle of the hips (0) to the neck (1), where girths are taken.
inline constexpr double kHipLevel = 0.03, kWaistLevel = 0.28, kChestLevel = 0.57, kShoulderLevel = 0.85;
/// Positions on the limbs, from the upper joint (0) to the lower one (1), where girths are taken.
inline constexpr double kUpperArmLevel = 0.55, kForearmLevel = 0.25, kWristLevel = 0.96, kThighLevel = 0.30,
                        kKneeLevel = 1.0, kCalfLevel = 0.28, kAnkleLevel = 0.86;

/// Warps points of a reference body to a body with other factors. Each segment stretches along its axis, and widens
/// across it by factors that run smoothly from level to level. A point moves with the weighted mean of its segments.
/// Neighbouring segments agree at the joint between them, so the surface stays smooth. The directions of the bones stay
/// as they are. The soles stay at the height of the reference's ground, y = 0, and the middle of the hips keeps x and
/// z.
class BodyWarp {
 public:
  /// @param reference completed joints in the rest pose: limbs straight, metres, y up, facing +z, soles at y = 0
  explicit BodyWarp(const BodyJoints& reference);

  /// The warp for given factors.
  class Map {
   public:
    /// @param reference a point of the reference body @param weights of the point
    Eigen::Vector3d point(const Eigen::Vector3d& reference, const SegmentWeights& weights) const;
    /// Where a point that is fixed to a segment's bone goes: as the surface does on head, hands and feet, in proportion
    /// to the bone's length elsewhere.
    Eigen::Vector3d bone_point(Segment segment, const Eigen::Vector3d& reference) const;
    /// The joints of the reference, moved. Girths do not move joints.
    BodyJoints joints() const;

   private:
    friend class BodyWarp;
    const BodyWarp* warp_ = nullptr;
    BodyFactors factors_;
    std::array<Eigen::Vector3d, kNumSegments> origin_;  ///< of each segment, moved
  };
  /// @param factors above 0. The map holds a pointer to this object.
  Map map(const BodyFactors& factors) const;

  const BodyJoints& reference() const { return joints_; }

 private:
  /// A segment of the reference: a frame at its first joint.
  struct Frame {
    Eigen::Vector3d origin;
    Eigen::Matrix3d axes;  ///< columns: along the bone, across to the body's side, across to the front
    double length = 1.0;   ///< from joint to joint
    Factor along = kTrunkLength;
  };
  struct Across;
  void set_frame(int segment, const Eigen::Vector3d& from, const Eigen::Vector3d& to, const Eigen::Vector3d& side,
                 Factor along);
  void set_limbs(bool left);
  Across across(int segment, double t, const Map& map) const;
  Eigen::Vector3d bone_point(int segment, const Eigen::Vector3d& reference, const Map& map) const;
  Eigen::Vector3d segment_point(int segment, const Eigen::Vector3d& reference, const Map& map) const;
  void put_origins(Map& map) const;
  void put_limbs(Map& map, int side) const;

  BodyJoints joints_;
  std::array<Frame, kNumSegments> frames_;
};

}  // namespace doppel
