#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {

/// The joints of a body from BlazePose's landmarks in space. BlazePose marks a shoulder above the centre of its joint,
/// an ankle above the foot, and so on; the offsets between both are constants of the code, in lengths of the trunk
/// (docs/results/bodies.md says where they were measured). The extra points nose, eyes, ears, hands (the middle of the
/// knuckles of index and little finger) and heels are taken as they are; `toe` is the ball of the foot.
/// @param points as in BodyPoints::positions, metres
/// @return the joints whose landmarks are known; `complete_joints` adds the others
/// @throws Error when a hip or a shoulder is missing
BodyJoints joints_from_points(const std::array<std::optional<Eigen::Vector3d>, kNumBodyLandmarks>& points);

}  // namespace doppel
