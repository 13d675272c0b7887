#pragma once

#include <span>

#include "doppel/core/builtin_file.h"

namespace doppel {

/// The configurations that `doppel make` trains with, by their names in `configs/small`.
extern const std::span<const BuiltinFile> kBuiltinRecipes;

}  // namespace doppel
