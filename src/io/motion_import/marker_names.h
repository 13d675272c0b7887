#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// The joints of a body that points of detectors and markers show: the index of each is its position in kMarkerJoints.
/// Parents first.
struct MarkerJoint {
  const char* name;
  int parent;  ///< -1 for the pelvis
};
inline constexpr std::array<MarkerJoint, 17> kMarkerJoints{{{"pelvis", -1},
                                                            {"left_hip", 0},
                                                            {"right_hip", 0},
                                                            {"neck", 0},
                                                            {"left_knee", 1},
                                                            {"right_knee", 2},
                                                            {"left_ankle", 4},
                                                            {"right_ankle", 5},
                                                            {"left_toe", 6},
                                                            {"right_toe", 7},
                                                            {"head", 3},
                                                            {"left_shoulder", 3},
                                                            {"right_shoulder", 3},
                                                            {"left_elbow", 11},
                                                            {"right_elbow", 12},
                                                            {"left_wrist", 13},
                                                            {"right_wrist", 14}}};

/// The points whose mean is each joint: [17] indices into the names, empty where nothing shows the joint. Names are
/// compared by their landmark_key, without what stands before a colon (`Subject:LASI`). Known are the names of
/// detectors
/// (`LKnee`, `left_knee`), of joint centres (`LKJC`) and of the markers of Plug-in Gait (`LKNE`), in this order.
/// @param on_skin set when a joint of the legs or arms is taken from markers on the skin, which lie some centimetres
///   beside it
std::array<std::vector<int>, kMarkerJoints.size()> match_markers(const std::vector<std::string>& names, bool& on_skin);

}  // namespace doppel
