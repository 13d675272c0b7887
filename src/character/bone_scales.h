#pragma once

#include "doppel/character/shape_family.h"

namespace doppel {

/// A character with bones of other lengths. The parameters are factors of the lengths, 1 for the character itself; a
/// pair of bones of the left and the right side shares one.
///
/// A bone c reaches from its parent's joint to its own: the offset o_c of the joint, |o_c| = L. The factor s_c scales
/// the offset. A point p that moves with the parent is stretched along the bone, in the rest pose:
///   p' = p + (s_c - 1) clamp(d_c . (p - a_c), 0, L) d_c,   d_c = o_c / L in the world, a_c the parent's joint,
/// so that points beside the bone are spread evenly and points beyond its end move with the end. A vertex blends the
/// positions that its bones give by its skinning weights. Markers move as points of their joint.
class BoneScales : public ShapeFamily {
 public:
  /// Bones shorter than this have no factor, metres.
  static constexpr double kMinLength = 0.03;

  explicit BoneScales(const Character& character);

  const std::vector<ShapeParameter>& parameters() const override { return parameters_; }
  Character character(std::span<const double> values) const override;

 private:
  /// A bone with a factor, in the rest pose.
  struct Bone {
    int joint = 0;      ///< its end
    int parameter = 0;  ///< whose factor
    Eigen::Vector3d start, direction;
    double length = 0.0;
  };
  Eigen::Vector3d stretch(int group, const Eigen::Vector3d& p, std::span<const double> factors) const;
  void move_markers(std::span<const double> factors, Skeleton& skeleton) const;

  Character character_;
  std::vector<ShapeParameter> parameters_;
  std::vector<Eigen::Affine3d> rest_;          ///< [J] world from joint
  std::vector<int> group_;                     ///< [J] the first of the joints that share one position and one motion
  std::vector<Bone> bones_;                    ///< ascending in their joints
  std::vector<std::vector<int>> group_bones_;  ///< [J] bones that start at the group
};

}  // namespace doppel
