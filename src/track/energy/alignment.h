#pragma once

#include <optional>
#include <vector>

#include "doppel/track/energy/pose_model.h"
#include "doppel/track/energy/triangulation.h"

namespace doppel {

/// How rigidly each landmark is attached to the root, [M]: 1 when only the root moves it, less the farther the other
/// unknowns move it.
std::vector<double> rigidity_of_landmarks(const PoseModel& model);

/// Moves and rotates the root such that the landmarks of a pose lie closest to given points (weighted Procrustes
/// without scale). The other DoFs keep their values.
/// @param points [M], world metres @param weights [M] of the landmarks
/// @return nothing when fewer than three points are given, all lie on a line, or the root cannot rotate freely
std::optional<std::vector<double>> align_root(const PoseModel& model, const std::vector<double>& dofs,
                                              const std::vector<std::optional<TriangulatedPoint>>& points,
                                              const std::vector<double>& weights);

}  // namespace doppel
