#include "doppel/track/fit/tracked_frame.h"

namespace doppel {

std::string to_string(FrameState state) {
  switch (state) {
    case FrameState::tracked:
      return "tracked";
    case FrameState::initialised:
      return "initialised";
    case FrameState::recovered:
      return "recovered";
    case FrameState::lost:
      return "lost";
  }
  return "unknown";
}

}  // namespace doppel
