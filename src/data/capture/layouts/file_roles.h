#pragma once

#include <set>
#include <string>

namespace doppel {

/// What files are for, by the words in their paths.
enum class FileRole {
  footage,
  masks,   ///< mask, fg, foregroundSegmentation, ...
  empty,   ///< the empty scene: empty, background, ...
  unused,  ///< pictures of calibration boards, depth, drawings, ...
};
FileRole role_of_file(const std::string& path);

/// The words of a path, or of a sequence (`CameraMatch::sequence`), that tell one sequence from another: without the
/// words of roles and kinds (videos, masks, cam, openpose, ...).
std::set<std::string> telling_words(const std::string& path);
/// The same words in their order, joined by "_".
std::string telling_name(const std::string& path);

}  // namespace doppel
