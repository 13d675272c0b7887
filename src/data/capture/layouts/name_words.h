#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace doppel {

/// A run of letters or of digits in a name: lower case, without the leading zeros of a number.
struct NameWord {
  std::string text;
  bool is_number = false;
};

/// The words of a name. Every other character separates words, and so does a capital after a small letter: "Cam_01b" is
/// cam, 1, b.
std::vector<NameWord> words_of(std::string_view name);

/// The words `begin` to `end` (excluded) as one text. Two numbers are kept apart by "_".
std::string joined_words(const std::vector<NameWord>& words, std::size_t begin, std::size_t end);

/// A name by the one rule that compares names of cameras and files: letters lowered, separators dropped, leading zeros
/// dropped. "cam_01", "Cam-1" and "cam1" are all "cam1".
std::string normalised_name(std::string_view name);

/// A text as the name of a capture or of a sequence: what is not allowed there becomes "_".
std::string usable_name(std::string text, const std::string& fallback);

/// The parts of a path between the slashes.
std::vector<std::string> path_parts(std::string_view path);

/// The folder of a path; empty when there is no slash.
std::string folder_of(const std::string& path);

/// Whether a word in small letters stands before the number of a camera: "cam" of "cam_3".
bool is_camera_word(const std::string& word);

/// What files are for, by the words in their paths.
enum class FileRole {
  footage,
  masks,   ///< mask, fg, foregroundSegmentation, ...
  empty,   ///< the empty scene: empty, background, ...
  unused,  ///< images of calibration boards, depth, drawings, ...
};
/// @param cameras names whose words are those of the camera and not of a role, as in a camera "alpha"
FileRole role_of_file(const std::string& path, const std::vector<std::string>& cameras = {});

/// The words of a path, or of a sequence (`CameraMatch::sequence`), that tell one sequence from another: without the
/// words of roles and kinds (videos, masks, cam, openpose, ...).
std::set<std::string> telling_words(const std::string& path);
/// The same words in their order, joined by "_".
std::string telling_name(const std::string& path);

}  // namespace doppel
