#pragma once

#include <string>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/core/config.h"

namespace doppel {

/// Which DoFs are looked for. Names of DoFs, in which * stands for any characters.
struct DofChoice {
  std::vector<std::string> dofs;  ///< those to find; empty: all that landmarks show (`observable_dofs`)
  std::vector<std::string> also;  ///< those to find as well
  std::vector<std::string> hold;  ///< those that keep the rest pose's values after all

  /// The keys `dofs`, `also` and `hold`; all may be missing.
  static DofChoice read(const ConfigReader& root);
};

/// The DoFs whose names fit one of the patterns, ascending. @param key of the configuration that they stand under
/// @throws UsageError for a pattern that no DoF of the skeleton fits
std::vector<int> named_dofs(const Skeleton& skeleton, const char* key, const std::vector<std::string>& patterns);
/// The DoFs that were chosen, ascending. @throws UsageError for a name that no DoF of the skeleton has
std::vector<int> chosen_dofs(const DofChoice& choice, const Skeleton& skeleton, const std::vector<Marker>& landmarks);

}  // namespace doppel
