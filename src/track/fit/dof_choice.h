#pragma once

#include <string>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/core/options.h"

namespace doppel {

/// Selects the DoFs that a fit finds, by names in which * stands for any characters.
struct DofChoice {
  std::vector<std::string> dofs;  ///< DoFs to find; empty: all that landmarks determine (`observable_dofs`)
  std::vector<std::string> also;  ///< further DoFs to find
  std::vector<std::string> hold;  ///< exceptions: DoFs that keep the values of the rest pose
};

/// The keys `dofs`, `also` and `hold`.
void describe_keys(const Keys& keys, DofChoice& choice);

/// The DoFs whose names match one of the patterns, ascending. @param key the configuration key of the patterns
/// @throws UsageError for a pattern that matches no DoF of the skeleton
std::vector<int> named_dofs(const Skeleton& skeleton, const char* key, const std::vector<std::string>& patterns);
/// The selected DoFs, ascending. @throws UsageError for a name that no DoF of the skeleton has
std::vector<int> chosen_dofs(const DofChoice& choice, const Skeleton& skeleton, const std::vector<Marker>& landmarks);

}  // namespace doppel
