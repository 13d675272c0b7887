#pragma once

#include "doppel/track/footage.h"
#include "doppel/track/livecap/livecap.h"

namespace doppel {

/// The input of the one-camera tracker from a frame.
inline LivecapInput livecap_input(const FootageFrame& seen) {
  return {seen.evidence.front(), seen.joints.empty() ? std::vector<JointDetection>() : seen.joints.front(),
          seen.images.front()};
}

}  // namespace doppel
