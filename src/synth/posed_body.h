#pragma once

#include <array>
#include <optional>
#include <vector>

#include "doppel/geometry/triangle_tree.h"
#include "doppel/synth/actor.h"
#include "doppel/synth/body_field.h"
#include "doppel/synth/cloth_solver.h"

namespace doppel::synth {

/// The actor's body below the skirt in a moving pose: the trunk and both legs, and each hand with its forearm.
///
/// Each part of the body field is rigid on its bone. A point is moved into the rest pose by the inverse transform of
/// each bone near it, and the distance to the bone's part is taken there; the distances are then joined as in the body
/// field. This is exact away from the joints and needs no inverse of the blended skinning, which is ambiguous between
/// the legs. Of another body than the actor's own, each part is the affine image of its own part (Actor::part_warps).
/// At a joint the parts are round cones with one common end, so the surface has no gap in any pose. The blended skin is
/// up to 2 cm farther out near a bent knee; `SkinPatch` adds it. Hands and legs are not joined with each other.
class PosedBody {
 public:
  /// @param actor must outlive the body
  explicit PosedBody(const Actor& actor);

  /// Moves the body. The former pose becomes the start of the motion in `touch`.
  /// @param dofs [D]
  void move(const std::vector<double>& dofs);

  /// The deepest contact of a point that must keep `thickness` metres from the body. @param p world metres
  std::optional<Touch> touch(const Eigen::Vector3d& p, double thickness) const;

  /// Distance to the body, metres, negative inside; a large number for points that are far away.
  double distance(const Eigen::Vector3d& p) const;

 private:
  using Group = std::vector<Part>;
  /// Distance to the joined parts of a group, and the part nearest to the point.
  struct Near {
    double distance;
    Part part;
  };
  Near near(const Group& group, const Eigen::Vector3d& p) const;
  Eigen::Vector3d gradient(const Group& group, const Eigen::Vector3d& p) const;

  /// A ball around a part in the rest pose of the actor's own body.
  struct Ball {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double radius = 0;
  };
  static Ball ball_around(Part part);

  /// A part on its bone.
  struct PosedPart {
    int joint = 0;
    bool warped = false;  ///< the body is not the actor's own, so the maps are not rigid
    Ball ball;
    Eigen::Affine3d joint_from_rest, world_from_rest, rest_from_world;
    Eigen::Affine3d before_from_now;  ///< where a point of the part was in the former pose, both in the world
  };

  const Character& character_;
  BodyField field_;
  std::vector<Group> groups_;
  std::array<PosedPart, kNumParts> parts_;
};

/// The skinned surface of trousers, shoes, arms and hands. The surface is open below the skirt, so it has no inside: it
/// touches only points that are a little below it.
class SkinPatch {
 public:
  explicit SkinPatch(const Actor& actor);
  /// Vertices below the skirt from this looseness on follow the skirt more than the legs and are no part of the patch.
  static constexpr double kFirm = 0.1;

  /// Moves the surface. The former positions become the start of the motion in `touch`.
  /// @param surface [N] skinned positions, world metres
  void move(const std::vector<Eigen::Vector3d>& surface);

  /// The contact of a point that must keep `thickness` metres from the surface. @param p world metres
  std::optional<Touch> touch(const Eigen::Vector3d& p, double thickness) const;

 private:
  std::vector<Triangle> faces_;  ///< of the character
  std::vector<char> at_border_;  ///< [N] 1 for vertices with faces that are no part of the patch
  std::vector<Eigen::Vector3d> now_, before_;
  TriangleTree tree_;
};

}  // namespace doppel::synth
