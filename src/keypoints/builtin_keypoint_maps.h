#pragma once

#include <span>

namespace doppel {

/// A file of configs/keypoints. The file is compiled in, so an installed program needs no data folder.
struct BuiltinKeypointMap {
  const char* name;
  const char* yaml;
};
extern const std::span<const BuiltinKeypointMap> kBuiltinKeypointMaps;

}  // namespace doppel
