#pragma once

#include <span>

namespace doppel {

/// A file of configs/networks. The file is compiled in, so an installed program needs no data folder.
struct BuiltinNetworkConfig {
  const char* name;
  const char* yaml;
};
extern const std::span<const BuiltinNetworkConfig> kBuiltinNetworkConfigs;

}  // namespace doppel
