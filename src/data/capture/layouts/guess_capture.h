#pragma once

#include <string>
#include <vector>

#include "doppel/data/capture/capture_guess.h"
#include "doppel/data/capture/layouts/folder_content.h"

namespace doppel {

/// What is known of a folder beforehand: regular expressions (ECMAScript) that the paths of files match. Of several,
/// the first that matches any file holds. None: by the words of the paths (`role_of_file`).
struct GuessHints {
  std::vector<std::string> calibration, videos, masks;
  int mask_threshold = SequenceEntry().mask_threshold;
};

/// Guesses a capture. Reads no file.
/// - The calibration is the one whose cameras match most files (`match_cameras`), by name rather than by order.
/// - Files whose paths differ in the camera alone are one sequence; masks, keypoints, motions and the empty scene
///   belong to the sequence whose words their paths hold, or to the only one.
/// - `fps` is that of most videos. A camera whose rate differs so much that it would be half a frame off at the end of
///   its video gets its own rate.
/// - Images that are numbered from n get the `frame_offset` n; each camera its own where they count on their own.
/// - Keypoints whose numbers cannot be those of the frames get a `keypoint_offset`.
CaptureGuess guess_capture(const FolderContent& content, const GuessHints& hints = {});

}  // namespace doppel
