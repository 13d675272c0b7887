#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/track/track_report.h"

namespace doppel {

/// An HTML page of every sequence: the result in a sentence and a few figures, the sheet of fits (`SEQUENCE.jpg` in
/// `out`, where it exists), and curves over the frames: overlap with the mask, distance from keypoints, and, where the
/// capture has ground truth, distances from its joints and vertices.
std::string track_curves(const std::filesystem::path& out, const TrackReport& report);

/// The part of this page about one sequence, and the page of such parts.
std::string track_section(const std::filesystem::path& out, const SequenceReport& sequence);
std::string track_page(const std::vector<std::string>& sections);

}  // namespace doppel
