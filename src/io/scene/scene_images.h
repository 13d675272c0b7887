#pragma once

#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <string>

#include "doppel/io/scene/scene_limits.h"

namespace doppel {

/// The image file that a surface names: as it is written, else by its name alone in the folder of the scene and in
/// folders beside it. Of a pattern of tiles (texture_tiles.h), the first tile that exists. Empty when there is none.
/// Slashes of both kinds are understood. A name without a file is read once more as a URI, in which %20 is a blank.
std::filesystem::path find_image(const std::filesystem::path& scene_file, std::string name);

/// The images of one scene file. Decoders allocate what a header announces, so the header is looked at first, and all
/// images together have a bound.
class SceneImages {
 public:
  SceneImages(const std::filesystem::path& scene_file, const SceneLimits& limits)
      : scene_file_(scene_file), limits_(limits) {}

  /// An 8-bit BGR image from the bytes of an image file; empty when they are none, damaged, or larger than the limit.
  cv::Mat of_bytes(const std::string& bytes);
  /// As above, of a file that the scene names (find_image). Each file is decoded once.
  cv::Mat of_file(const std::string& name);

 private:
  std::filesystem::path scene_file_;
  SceneLimits limits_;
  double pixels_ = 0;  ///< of all images so far
  std::map<std::filesystem::path, cv::Mat> known_;
};

}  // namespace doppel
