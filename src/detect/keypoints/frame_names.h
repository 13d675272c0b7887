#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace doppel {

/// The last group of digits in a file's name without its extension, as a frame number: 31 for `cam01.0031.json`, 12 for
/// `video_000000000012_keypoints.json`. Nothing if there is none, or more than 15 digits.
std::optional<long> number_in_name(const std::string& name);

/// Order of names in which numbers count as numbers: `frame_9` comes before `frame_10`.
bool natural_less(std::string_view a, std::string_view b);

/// The frames of files or images. They are the numbers in the names if every name has one and no two are equal,
/// otherwise the positions of the names in natural order, from 0.
struct NumberedNames {
  std::vector<long> frames;  ///< [n]
  bool by_position = false;
};
/// @param names unique
NumberedNames number_names(const std::vector<std::string>& names);

}  // namespace doppel
