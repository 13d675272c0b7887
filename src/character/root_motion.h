#pragma once

#include <Eigen/Core>
#include <optional>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"

namespace doppel {

/// How far a person gets along the ground: a turn about the vertical (y), and a way. A root at p comes to
/// to + R_y(turn) (p - from).
struct GroundStep {
  double turn = 0.0;  ///< radians
  /// (x, z) of the root before and after, metres, relative to where it is when its translations are 0.
  Eigen::Vector2d from = Eigen::Vector2d::Zero(), to = Eigen::Vector2d::Zero();

  Eigen::Vector2d way() const { return to - from; }
};

/// The root of the skeleton if it is three translations followed by three rotations, which the functions below need.
std::optional<Skeleton::Root> root_that_travels(const Skeleton& skeleton);

/// (x, z) of the root, as in GroundStep. @param dofs [D]
Eigen::Vector2d ground_position(const Skeleton::Root& root, const std::vector<double>& dofs);

/// The step that takes some frames of a motion to as many later ones: the mean turn of the root about the vertical, and
/// the means of its positions. @param first, later frames of the motion @param count of frames from each of them on
GroundStep ground_step(const Skeleton::Root& root, const Motion& motion, int first, int later, int count);

/// The pose before a step, given that after it: only position and heading of the root differ.
/// @param like a pose with nearly this rotation of the root, whose angles the result is near
std::vector<double> before_step(const Skeleton::Root& root, std::vector<double> dofs, const GroundStep& step,
                                const std::vector<double>& like);

/// The motion with the root above one point of the ground, where the first frame has it. Height and rotation stay.
Motion in_place(const Skeleton::Root& root, Motion motion);

}  // namespace doppel
