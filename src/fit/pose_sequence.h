#pragma once

#include <optional>
#include <vector>

#include "doppel/energy/root_rotation.h"

namespace doppel {

/// The poses of consecutive frames, [F][D], and where segments begin (`cuts`: frames counted from 0, ascending).
/// Nothing below reaches over a cut.

/// Gives lost frames a pose: between two frames of a segment that were found the way from one to the other, at
/// the ends of a segment that of the nearest one; a segment without any takes the nearest of the sequence. The root
/// turns about one axis where `root` is given. When all frames are lost nothing changes.
void bridge_poses(std::vector<std::vector<double>>& poses, const std::vector<bool>& found,
                  const std::vector<long>& cuts, const std::optional<RootRotation>& root);

/// Averages each pose with its neighbours under a Gaussian; rotations of the root are averaged as matrices. The root's
/// angles are made continuous. @param sigma frames; 0: only the latter
/// @param degree 0: the mean of the poses, two sigma far, which cuts off the peaks of quick movements; 2: the parabola
///   that fits them best, three sigma far, which keeps them and takes away as much noise with some 1.7 times the sigma
void smooth_poses(std::vector<std::vector<double>>& poses, const std::vector<long>& cuts,
                  const std::optional<RootRotation>& root, double sigma, int degree = 0);

}  // namespace doppel
