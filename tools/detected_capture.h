#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "command.h"

namespace doppel::tools {

/// @throws UsageError when `out` holds the capture.yaml of `source`, which the results would replace
void check_detect_out(const std::filesystem::path& source, const std::filesystem::path& out);

/// Writes `out/capture.yaml`: the capture `source` with the files that were detected as keypoints and joints in space,
/// and as masks where they were written and the sequence has none. The detected keypoints are those of one person, so
/// the key `person` is left out. Nothing is written for a source that is no capture.
/// @param report that of `doppel detect` @param keep_keypoints whether keypoints of the capture stay
void write_detected_capture(const std::filesystem::path& source, const std::filesystem::path& out,
                            const nlohmann::ordered_json& report, bool keep_keypoints = false);

/// `doppel detect CAPTURE --out DIR [--masks]` (detect_command.cpp). @return false when the user stopped it
bool detect_capture(const std::filesystem::path& capture, const std::filesystem::path& out, bool masks,
                    const CommonOptions& common);

/// Whether with_keypoints would run the detection, or use its earlier results.
bool lacks_keypoints(const std::filesystem::path& path);

/// What a command needs besides keypoints.
struct DetectNeeds {
  bool masks = false;  ///< they are detected where a sequence has none
  bool character = false;
};

/// The capture with keypoints: `path` itself, or, if its sequences name neither keypoints nor a detector, the
/// description in `folder` that detect_capture writes. Results in `folder` that are newer than the capture and its
/// videos are used again.
/// @throws Error when the user stopped the detection, and without a character that the caller needs
std::filesystem::path with_keypoints(const std::filesystem::path& path, const std::filesystem::path& folder,
                                     const DetectNeeds& needs, const CommonOptions& common);

}  // namespace doppel::tools
