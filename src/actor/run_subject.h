#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "doppel/character/character.h"
#include "doppel/core/config.h"

namespace doppel {

/// The settings that all stages of a run share: the top level of a configuration.
struct RunSubject {
  std::filesystem::path capture;  ///< prepared folder, absolute
  std::int64_t seed = 1;
  CharacterOptions character;

  /// Reads `stage` (which must be `stage`), `capture`, `seed` and the section `character`.
  /// @throws UsageError when no capture is named
  static RunSubject read(const ConfigDocument& document, const ConfigReader& root, const std::string& stage);
};

}  // namespace doppel
