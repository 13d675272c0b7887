#pragma once

/// What the TOML formats of calibrations share: Pose2Sim, aniposelib, FreeMoCap and Caliscope have tables with the same
/// keys.

#include <toml++/toml.h>

#include <filesystem>
#include <string>
#include <string_view>

#include "doppel/core/error.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// Reads a TOML file. @throws FileError with the line of the fault
toml::table toml_calibration_root(const std::filesystem::path& path);
/// The value of a key, or nullptr. Caliscope writes "null" where it has no value.
const toml::node* toml_calibration_value(const toml::table& table, std::string_view key);
/// The camera of a table with matrix, distortions, fisheye and size, without its pose. @param name of the table
Camera toml_calibration_camera(const toml::table& table, const std::string& name, const FileLocation& where);
/// Sets the pose from rotation (a vector, or a matrix) and translation: X_cam = R X + t.
/// @return whether the table has them
bool toml_calibration_pose(const toml::table& table, Camera& camera, const FileLocation& where);

}  // namespace doppel
