#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace doppel {

/// Curves over time of what `track.json` says of each frame: overlap with the masks, distance from keypoints and from
/// the truth, where these are known. @return a page for a browser
std::string track_curves(const nlohmann::ordered_json& report);

}  // namespace doppel
