#pragma once

#include <span>

#include "doppel/core/builtin_file.h"

namespace doppel {

/// The files of configs/networks.
extern const std::span<const BuiltinFile> kBuiltinNetworkConfigs;

}  // namespace doppel
