#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace doppel::tools {

/// What a file says that Doppel reads beside characters, captures and calibrations: a scan, a rigged figure, a motion,
/// markers, keypoints, a video, an image, an exported actor. `kind` comes first, and `read_by` is the command that
/// takes the file. The extension decides, and the content of tables and JSON files. Nothing for other files.
/// @throws FileError as the reader of the kind; for a table or JSON that no reader takes, with the reason of each
std::optional<nlohmann::ordered_json> describe_file(const std::filesystem::path& path);

/// A scan or a rigged figure; any format that read_scene reads. @throws FileError as read_scene
nlohmann::ordered_json describe_surface(const std::filesystem::path& path);

/// Whether the extension is one that describe_file knows.
bool is_described(const std::filesystem::path& path);

/// Whether the extension is that of a video or of an image.
bool is_footage(const std::filesystem::path& path);

/// The kinds of files that `doppel info` describes, with their extensions, for messages.
std::string described_files();

}  // namespace doppel::tools
