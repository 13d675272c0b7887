#pragma once

#include <array>
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
/// compared by their landmark_key. Known are the names of detectors (`LKnee`, `left_knee`), of joint centres (`LKJC`)
/// and of the markers of Plug-in Gait (`LKNE`), in this order.
struct MatchedMarkers {
  std::array<std::vector<int>, kMarkerJoints.size()> points;
  /// Whether a joint of the legs or arms is taken from markers on the skin, which lie some centimetres beside it.
  bool on_skin = false;

  /// Whether these joints are enough of a body: pelvis or both hips, a knee and four more joints.
  bool show_a_body() const;
};

/// One person among the points of a file.
struct MarkerPerson {
  std::string name;  ///< kUnnamedPerson for points without a name before them
  MatchedMarkers markers;
};
inline constexpr const char* kUnnamedPerson = "unnamed";

/// The people whose points a file holds, in the order of its points. The name of a person stands before that of the
/// point, divided by a colon (`Anna:LKnee`), or by a blank, `_`, `.`, `-`, `/` or `|` where the rest is a known name
/// (`Anna_left_knee`). Points without a person belong to the only person there is. Whoever shows less than three joints
/// is a tool or a label, and is no person; where nobody shows more, all points are one person without a name.
std::vector<MarkerPerson> marker_people(const std::vector<std::string>& names);

}  // namespace doppel
