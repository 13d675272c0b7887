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

/// Whether the names of files tell when they were filmed and not which frame they are: names that differ in several
/// numbers (date and time, seconds and a fraction) or in one that is too large for a frame, or hold a date and a time
/// and a fraction of a second. Frames that follow each other without such numbers in their names are none of these.
bool hold_times(const std::vector<std::string>& names);

/// Whether each name has a date and a time, or the seconds since 1970, before its last number.
bool are_dated(const std::vector<std::string>& names);

/// Puts names in their natural order. A number behind a point counts as the fraction that it is if the names hold
/// times.
std::vector<std::size_t> order_of_names(const std::vector<std::string>& names);

/// The frames of files or images. They are the numbers in the names if every name has one, no two are equal, and the
/// names do not hold times; otherwise the positions of the names in natural order, from 0.
struct NumberedNames {
  std::vector<long> frames;  ///< [n]
  bool by_position = false;
};
/// @param names unique
NumberedNames number_names(const std::vector<std::string>& names);

}  // namespace doppel
