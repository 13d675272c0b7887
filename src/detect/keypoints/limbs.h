#pragma once

#include <array>
#include <string>
#include <vector>

namespace doppel {

/// Two points that are neighbours on the body: names as `landmark_key` gives them.
using NamedLimb = std::array<const char*, 2>;
/// Arms, legs and the outline of the trunk.
inline constexpr std::array<NamedLimb, 12> kBodyLimbs{{{"left_shoulder", "left_elbow"},
                                                       {"right_shoulder", "right_elbow"},
                                                       {"left_elbow", "left_wrist"},
                                                       {"right_elbow", "right_wrist"},
                                                       {"left_shoulder", "left_hip"},
                                                       {"right_shoulder", "right_hip"},
                                                       {"left_shoulder", "right_shoulder"},
                                                       {"left_hip", "right_hip"},
                                                       {"left_hip", "left_knee"},
                                                       {"right_hip", "right_knee"},
                                                       {"left_knee", "left_ankle"},
                                                       {"right_knee", "right_ankle"}}};

/// The lines of a stick figure: the limbs, the feet, the head and the fingers, as far as both ends are among the
/// points.
/// @param names of the points, in any spelling (landmark_key) @return pairs of indices
std::vector<std::array<int, 2>> sticks_between(const std::vector<std::string>& names);

}  // namespace doppel
