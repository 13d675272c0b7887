#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "doppel/character/character.h"
#include "doppel/core/config.h"
#include "doppel/core/options.h"
#include "doppel/data/dataset/dataset.h"

namespace doppel {

/// The settings that all stages of a run share: the top level of a configuration.
struct RunSubject {
  std::filesystem::path capture;  ///< prepared folder, absolute
  std::int64_t seed = 1;
  CharacterOptions character;
  ValidationFrames validation;

  /// Reads `stage` (which must be `stage`), `capture`, and the keys of `describe_keys`.
  /// @throws UsageError when no capture is named
  static RunSubject read(const ConfigDocument& document, const ConfigReader& root, const std::string& stage);

  /// Takes a capture. For another capture than that of the run, `validation` is cleared, with a warning.
  void use_capture(const std::filesystem::path& folder);
  /// Opens the capture with its validation frames set aside. @throws as Dataset::open and Dataset::hold_out
  Dataset open_dataset() const;
};
/// The keys `seed`, `character` and `validation` of the top level.
void describe_keys(const Keys& keys, RunSubject& subject);

}  // namespace doppel
