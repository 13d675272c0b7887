#include "doppel/fit/livecap/landmark_roles.h"

#include "doppel/fit/words.h"

namespace doppel {

LandmarkRoles landmark_roles(const std::vector<Marker>& landmarks) {
  LandmarkRoles roles;
  for (const Marker& landmark : landmarks) {
    const std::string name = lower_case(landmark.name);
    const bool shoulder = holds_any(name, {"shoulder"});
    const bool face = ends_with(name, "ear") || holds_any(name, {"nose", "eye", "chin", "jaw"});
    const bool trunk = face || holds_any(name, {"neck", "head", "hip", "spine", "pelvis", "chest"});
    roles.detection.push_back(face ? 0.326 : 1.0);
    roles.steadiness.push_back(shoulder ? 2.0 : trunk ? 2.5 : holds_any(name, {"knee", "elbow"}) ? 1.5 : 1.0);
  }
  return roles;
}

}  // namespace doppel
