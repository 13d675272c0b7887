#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace doppel::deviations {

/// What the thesis says about one key of a preset.
struct KeyEntry {
  /// `printed`: our value is the thesis's. `silent`: the thesis states none. `off`: something that the thesis does not
  /// have, switched off.
  enum class Kind { printed, deviates, silent, off };
  Kind kind = Kind::silent;
  std::string ours, thesis, section, why;
};

/// A difference that no key can express.
struct OtherDeviation {
  std::string thesis, ours, section, why;
};

struct PresetValues {
  std::string name;                        ///< of `configs/paper/NAME.yaml`
  std::map<std::string, KeyEntry> keys;    ///< by dotted key
  std::map<std::string, KeyEntry> common;  ///< by the end of a dotted key, for all presets

  /// The entry of a key, of `keys` or else of `common`; null: none.
  const KeyEntry* find(const std::string& key) const;
  std::vector<OtherDeviation> others;
};

/// The content of `docs/results/thesis_values.yaml`.
struct ThesisValues {
  std::vector<PresetValues> presets;
  std::vector<std::string> machine;  ///< endings of keys that do not change what is computed

  static ThesisValues load(const std::filesystem::path& path);
};

/// Whether two texts say the same: as numbers if both are numbers.
bool same_value(const std::string& a, const std::string& b);
/// Every key that the readers of a preset ask for, with its value; keys of a chain begin with the stage.
std::map<std::string, std::string> preset_values(const std::string& name, const std::filesystem::path& file);
/// The page `docs/results/deviations.md`.
std::string deviations_page(const ThesisValues& values);

}  // namespace doppel::deviations
