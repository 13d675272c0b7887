#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "doppel/io/rig_import/import_rig.h"

namespace doppel {

/// The motions of an imported rig as `motions.json` lists them: file, animation, frames, rate, start and error.
nlohmann::ordered_json motions_json(const ImportedRig& rig);

/// The frames per second that a `motions.json` beside a motion gives for it, or nothing: not an imported motion.
/// @throws FileError when `motions.json` cannot be parsed
std::optional<double> imported_rate(const std::filesystem::path& motion);

}  // namespace doppel
