#include "doppel/track/energy/landmark_weight.h"

#include "doppel/detect/hands/hand_pose.h"

namespace doppel {

double landmark_weight(const std::string& name) { return is_hand_point(name) ? 3.0 / kNumHandPoints : 1.0; }

}  // namespace doppel
