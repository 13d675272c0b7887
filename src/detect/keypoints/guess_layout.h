#pragma once

#include <optional>
#include <string>
#include <vector>

#include "doppel/core/error.h"
#include "doppel/detect/keypoints/format.h"

namespace doppel {

/// The built-in layout of detected people: by the names of the points if the file states them, otherwise by their
/// number. Two numbers have two layouts each: 25 (body25, body25b) and 17 (coco17, h36m17). There the layout is taken
/// in whose order the limbs are clearly shorter, over all people.
/// @return its name; nothing when nobody was detected
/// @throws FileError for a number of points that no built-in layout has, and where the limbs do not decide; the message
/// asks for `keypoint_map`
std::optional<std::string> guess_layout(const std::vector<Detections>& detections, const FileLocation& where);

/// The same for what KeypointSource takes: a path with `{frame}`, a folder, or a file of all frames. Of files per
/// frame, some are read.
std::optional<std::string> guess_layout(const std::string& path, const KeypointCamera& camera);

}  // namespace doppel
