#pragma once

#include "doppel/track/footage.h"
#include "doppel/track/livecap/livecap.h"

namespace doppel {

/// The input of the one-camera tracker from a frame.
inline LivecapInput livecap_input(const FootageFrame& seen) {
  LivecapInput input{seen.evidence.front(), {}, seen.images.front()};
  if (seen.joints.empty()) return input;
  for (const JointDetection& joint : seen.joints.front())
    input.joints.push_back(joint.seen ? std::optional<Eigen::Vector3d>(joint.position) : std::nullopt);
  return input;
}

}  // namespace doppel
