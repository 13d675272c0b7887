#pragma once

#include <span>

#include "doppel/core/builtin_file.h"

namespace doppel {

/// The files of configs/keypoints.
extern const std::span<const BuiltinFile> kBuiltinKeypointMaps;

}  // namespace doppel
