#pragma once

#include <optional>
#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/pose_model.h"

namespace doppel {

/// The translation that moves the points of a body onto their keypoints in one camera: the t that brings all p_m + t
/// nearest to the rays of the keypoints (as 5.4, one camera).
/// @param points [M] world axes, metres; missing ones are ignored @param keypoints [M]
/// @return nothing when fewer than four points remain, t is not determined, or it leads behind the camera
std::optional<Eigen::Vector3d> shift_onto_rays(const PinholeCamera& camera, const std::vector<Keypoint>& keypoints,
                                               const std::vector<std::optional<Eigen::Vector3d>>& points);

/// Initial poses for a frame without a prediction. With 3D joints: the pose whose root is aligned to them. Without: the
/// rest pose with four headings. All are moved onto the rays of the keypoints.
/// @param joints [M] world axes, metres, from any origin; all missing: no 3D joints
/// @param rigidity [M] `rigidity_of_landmarks`
/// @param rest [D] values of the DoFs that are not set
/// @return empty when no pose can be moved onto the rays
std::vector<std::vector<double>> single_view_starts(const PoseModel& model, const PinholeCamera& camera,
                                                    const std::vector<Keypoint>& keypoints,
                                                    const std::vector<std::optional<Eigen::Vector3d>>& joints,
                                                    const std::vector<double>& rigidity,
                                                    const std::vector<double>& rest);

}  // namespace doppel
