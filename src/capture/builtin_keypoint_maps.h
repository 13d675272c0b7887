#pragma once

#include <array>

namespace doppel {

/// A file of configs/keypoints. The file is compiled in, so an installed program needs no data folder.
struct BuiltinKeypointMap {
  const char* name;
  const char* yaml;
};
extern const std::array<BuiltinKeypointMap, 3> kBuiltinKeypointMaps;

}  // namespace doppel
