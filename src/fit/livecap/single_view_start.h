#pragma once

#include <optional>
#include <vector>

#include "doppel/energy/evidence.h"
#include "doppel/energy/pose_model.h"

namespace doppel {

/// Where a body must be moved so that one camera sees its points where they were detected: the shift t that brings all
/// p_m + t nearest to the rays of the detections (as 5.4, one camera).
/// @param points [M] world axes, metres; missing ones do not count @param keypoints [M]
/// @return nothing when fewer than four points count, the shift is not determined, or it leads behind the camera
std::optional<Eigen::Vector3d> shift_onto_rays(const Camera& camera, const std::vector<Keypoint>& keypoints,
                                               const std::vector<std::optional<Eigen::Vector3d>>& points);

/// Poses to start from when nothing is known of the last frame. With joints in space: the root laid on them. Without:
/// the rest pose, turned to four sides about the world's vertical. All are moved onto the rays of the keypoints.
/// @param rest [D] what the other DoFs are set to
/// @param joints [M] world axes, metres, from any origin; all missing: none are known
/// @param rigidity [M] `rigidity_of_landmarks`
/// @return none when no pose can be placed
std::vector<std::vector<double>> single_view_starts(const PoseModel& model, const Camera& camera,
                                                    const std::vector<Keypoint>& keypoints,
                                                    const std::vector<std::optional<Eigen::Vector3d>>& joints,
                                                    const std::vector<double>& rigidity,
                                                    const std::vector<double>& rest);

}  // namespace doppel
