#include "doppel/io/motion_import/rest_figure.h"

namespace doppel {

const std::array<FigureJoint, 22>& rest_figure() {
  static const std::array<FigureJoint, 22> kJoints{{{"pelvis", -1, {0.0, 0.960, 0.0}},
                                                    {"left_hip", 0, {0.085, 0.901, 0.0}},
                                                    {"right_hip", 0, {-0.085, 0.901, 0.0}},
                                                    {"spine1", 0, {0.0, 1.060, -0.010}},
                                                    {"left_knee", 1, {0.085, 0.4845, 0.0}},
                                                    {"right_knee", 2, {-0.085, 0.4845, 0.0}},
                                                    {"spine2", 3, {0.0, 1.180, -0.010}},
                                                    {"left_ankle", 4, {0.085, 0.0663, 0.0}},
                                                    {"right_ankle", 5, {-0.085, 0.0663, 0.0}},
                                                    {"spine3", 6, {0.0, 1.240, -0.010}},
                                                    {"left_foot", 7, {0.085, 0.020, 0.130}},
                                                    {"right_foot", 8, {-0.085, 0.020, 0.130}},
                                                    {"neck", 9, {0.0, 1.450, -0.010}},
                                                    {"left_collar", 9, {0.070, 1.370, -0.010}},
                                                    {"right_collar", 9, {-0.070, 1.370, -0.010}},
                                                    {"head", 12, {0.0, 1.540, 0.010}},
                                                    {"left_shoulder", 13, {0.180, 1.391, -0.010}},
                                                    {"right_shoulder", 14, {-0.180, 1.391, -0.010}},
                                                    {"left_elbow", 16, {0.4962, 1.391, -0.010}},
                                                    {"right_elbow", 17, {-0.4962, 1.391, -0.010}},
                                                    {"left_wrist", 18, {0.7444, 1.391, -0.010}},
                                                    {"right_wrist", 19, {-0.7444, 1.391, -0.010}}}};
  return kJoints;
}

}  // namespace doppel
