#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

namespace doppel {

/// Three different axes (0 x, 1 y, 2 z), outermost first: R = R_a(q0) R_b(q1) R_c(q2).
using EulerOrder = std::array<int, 3>;

/// The angles of a rotation about three axes of the world, radians. Of the two solutions, the one nearer to `before`;
/// q0 and q2 are the multiples of a turn nearest to it.
Eigen::Vector3d euler_angles(const Eigen::Matrix3d& rotation, const EulerOrder& order, const Eigen::Vector3d& before);

/// The order whose middle angle stays farthest from +-90 degrees, where the other two lose their meaning. Where it is
/// far enough away, the first order.
/// @param preferred outermost first
EulerOrder choose_euler_order(const std::vector<Eigen::Quaterniond>& rotations, const EulerOrder& preferred);

}  // namespace doppel
