#pragma once

#include <string>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// The DoFs whose names fit a pattern in which * stands for any characters, ascending.
std::vector<int> find_dofs(const Skeleton& skeleton, const std::string& pattern);

}  // namespace doppel
