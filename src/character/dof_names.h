#pragma once

#include <string>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// The DoFs whose names match a pattern, ascending. A `*` in the pattern stands for any characters.
std::vector<int> find_dofs(const Skeleton& skeleton, const std::string& pattern);

}  // namespace doppel
