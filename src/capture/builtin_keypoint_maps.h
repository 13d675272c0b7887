#pragma once

#include <array>

namespace doppel {

/// A file of configs/keypoints, compiled in so that an installed program needs no folder beside it.
struct BuiltinKeypointMap {
  const char* name;
  const char* yaml;
};
extern const std::array<BuiltinKeypointMap, 3> kBuiltinKeypointMaps;

}  // namespace doppel
