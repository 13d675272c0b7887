#pragma once

#include <optional>
#include <vector>

#include "doppel/track/energy/root_rotation.h"

namespace doppel {

/// Functions on the poses of consecutive frames, [F][D]. `cuts` are the frames that begin a segment, counted from 0,
/// ascending. Neither function averages or interpolates across a cut.

/// Bridges lost frames. Between two found frames of a segment the pose is interpolated. At the ends of a segment it is
/// that of the nearest found frame of the segment; a segment without found frames takes the nearest of the sequence.
/// Where `root` is given, the root's interpolated rotation is about one axis. When all frames are lost nothing changes.
void bridge_poses(std::vector<std::vector<double>>& poses, const std::vector<bool>& found,
                  const std::vector<long>& cuts, const std::optional<RootRotation>& root);

/// Averages each pose with its neighbours under a Gaussian; rotations of the root are averaged as matrices. The root's
/// angles are made continuous. @param sigma frames; 0: angles are made continuous, nothing is averaged
/// @param degree of the local polynomial. 0: the weighted mean within two sigma, which flattens the peaks of fast
///   motions. 2: the best-fitting parabola within three sigma, which keeps peaks; it removes as much noise with about
///   1.7 times the sigma
void smooth_poses(std::vector<std::vector<double>>& poses, const std::vector<long>& cuts,
                  const std::optional<RootRotation>& root, double sigma, int degree = 0);

}  // namespace doppel
