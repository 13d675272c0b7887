#pragma once

#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// Fills in the placeholders of a path pattern.
/// - `{camera}` the camera's index in the calibration file, `{camera:03}` with at least three digits
/// - `{name}` its name, `{frame}` and `{frame:012}` the frame number
/// @param frame not needed when the pattern has no {frame}
/// @throws Error for an unknown placeholder, an unclosed brace, or more than 20 digits
std::string expand_pattern(const std::string& pattern, int camera, const std::string& name,
                           std::optional<long> frame = std::nullopt);
/// As above, but leaves `{frame...}` unchanged.
std::string expand_camera(const std::string& pattern, int camera, const std::string& name);
/// @throws Error when a path has braces: patterns in that folder would take its name for a placeholder
void check_without_braces(const std::string& folder);
/// Whether a pattern contains {frame}.
bool has_frame_placeholder(const std::string& pattern);
/// The frames of which a file exists, ascending: the numbers at {frame} in the names of the files, or of the folders
/// that hold them.
/// @pre has_frame_placeholder; no other placeholder is left
std::vector<long> frames_of_pattern(const std::string& pattern);

}  // namespace doppel
