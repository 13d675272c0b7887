#pragma once

#include <optional>
#include <vector>

#include "doppel/energy/pose_model.h"
#include "doppel/energy/triangulation.h"

namespace doppel {

/// How firmly each landmark sits on the root: 1 for one that only the root moves, less the farther the other unknowns
/// move it. [M]
std::vector<double> rigidity_of_landmarks(const PoseModel& model);

/// Places and turns the root so that the landmarks of a pose lie best on given points (weighted Procrustes without
/// scale). The other DoFs stay.
/// @param points [M], @param weights [M] of the landmarks
/// @return nothing when fewer than three points are given, or all lie on a line, or the root cannot be turned freely
std::optional<std::vector<double>> align_root(const PoseModel& model, const std::vector<double>& dofs,
                                              const std::vector<std::optional<TriangulatedPoint>>& points,
                                              const std::vector<double>& weights);

}  // namespace doppel
