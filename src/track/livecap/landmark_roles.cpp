#include "doppel/track/livecap/landmark_roles.h"

#include <fmt/ranges.h>

#include "doppel/core/log.h"
#include "doppel/core/lower_case.h"
#include "doppel/track/fit/words.h"

namespace doppel {

LandmarkRoles landmark_roles(const std::vector<Marker>& landmarks) {
  LandmarkRoles roles;
  std::vector<std::string> unknown;
  for (const Marker& landmark : landmarks) {
    const std::string name = lower_case(landmark.name);
    const bool shoulder = holds_any(name, {"shoulder"});
    const bool face = name.ends_with("ear") || holds_any(name, {"nose", "eye", "chin", "jaw"});
    const bool trunk = face || holds_any(name, {"neck", "head", "hip", "spine", "pelvis", "chest"});
    roles.detection.push_back(face ? 0.326 : 1.0);
    const bool middle = holds_any(name, {"knee", "elbow"});
    roles.steadiness.push_back(shoulder ? 2.0 : trunk ? 2.5 : middle ? 1.5 : 1.0);
    const bool end = holds_any(name, {"wrist", "hand", "finger", "thumb", "ankle", "foot", "toe", "heel"});
    if (holds_any(name, {"heel", "toe"})) roles.soles.push_back(static_cast<int>(roles.detection.size()) - 1);
    if (!shoulder && !trunk && !middle && !end) unknown.push_back(landmark.name);
  }
  if (!unknown.empty())
    log::warn(
        "landmarks without a role: {}. Their names name no part of the body, so the weights of (4.3) and (4.6) are 1 "
        "for them; rename them, for example left_knee",
        fmt::join(unknown, ", "));
  return roles;
}

}  // namespace doppel
