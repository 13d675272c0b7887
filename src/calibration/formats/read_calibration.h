#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/calibration/formats/calibration.h"

namespace doppel {

/// Reads the calibration of a file or a folder. The content decides the format, not the name;
/// docs/calibration.md lists the formats. Where the format does not state the unit, it is found by the extent of the
/// cameras; where it does not state the axis that points up, by the mean direction that is up in the images. Options
/// override what the file states, with a note.
/// @throws FileError for a file of an unknown kind, or one that is truncated or impossible; UsageError for an option
/// with another value; Camera::faults checks every camera
Calibration load_calibration(const std::filesystem::path& path, const CalibrationOptions& options = {});

/// The rotation that turns the axis `up` of a file's world to +y: the program's world from the file's.
/// @param up "+x" ... "-z" @throws UsageError for another word
Eigen::Matrix3d y_up_from_file(const std::string& up);

/// Whether a file or a folder is of one of the formats.
bool is_calibration(const std::filesystem::path& path);

/// The cameras of a calibration that has poses. Their width and height are 0 if the file does not state them.
/// @throws FileError as load_calibration, and when the poses are missing
std::vector<Camera> read_posed_cameras(const std::filesystem::path& path, const CalibrationOptions& options = {});

/// The cameras of a calibration that has all sizes and poses.
/// @throws FileError as read_posed_cameras, and when the size of an image is missing
std::vector<Camera> read_calibration(const std::filesystem::path& path, const CalibrationOptions& options = {});

/// Writes cameras. `format` is a name that `calibration_writers` lists; empty: by the extension, `.calibration`
/// (Skeletool, mm), `.toml` (metres) or `.yml`/`.yaml`/`.json`/`.xml` (OpenCV, metres). Reading the file back gives the
/// same doubles for Skeletool and OpenCV, and doubles within rounding for the others. Formats of several files write a
/// folder.
/// @throws Error for another format or extension, and for cameras that the format cannot hold
void write_calibration(const std::filesystem::path& path, const std::vector<Camera>& cameras,
                       const std::string& format = "");
/// The same for intrinsics without poses. Reading the file back finds `has_poses` false for OpenCV and TOML; formats
/// that must state a pose state the same for all cameras. @throws as write_calibration
void write_intrinsics(const std::filesystem::path& path, const std::vector<Camera>& cameras,
                      const std::string& format = "");
/// Checks before long work what can be known of write_calibration: the format, and whether the path is free for it.
/// @param has_distortion whether cameras with lens distortion will be written
/// @throws Error for another format or extension; UsageError for a format without distortion, and for a folder in the
/// way
void check_calibration_target(const std::filesystem::path& path, const std::string& format, bool has_distortion);
std::vector<std::string> calibration_writers();

}  // namespace doppel
