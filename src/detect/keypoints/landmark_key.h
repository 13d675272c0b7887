#pragma once

#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// What all spellings of a body part have in common. `RShoulder`, `right_shoulder`, `Right Shoulder`, `R_SHOULDER`,
/// `rightShoulder` and `shoulder.R` have one key, and so have names of the same part: `MidHip`, `pelvis`, `root`, and
/// `hip` without a side; `head` and `HeadTop`, the top of the head. Landmarks, points of detectors and the names in
/// tables are compared by this key, unless a name is found exactly as written.
/// @return lower case letters and digits, with `left_` or `right_` before them if the name states a side. Other bytes
/// are separators; a name that holds nothing else is its own key
std::string landmark_key(const std::string& name);

/// The index of a landmark in a list: the name exactly as written, otherwise the first with the same key.
std::optional<int> find_landmark(const std::vector<std::string>& names, const std::string& name);

/// [n] for each name the index of the same part on the other side of the body, its own index if there is none.
std::vector<int> mirrored_indices(const std::vector<std::string>& names);

}  // namespace doppel
