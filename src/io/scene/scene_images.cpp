#include "doppel/io/scene/scene_images.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/geometry/encoded_image.h"
#include "doppel/io/scene/tile_name.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr double kMaxScenePixels = 5.4e8;  // of all images of a scene: 1.6 GB

}  // namespace

cv::Mat SceneImages::of_bytes(const std::string& bytes) {
  const auto size = announced_image_size(bytes);
  if (!size || size->maxCoeff() > limits_.image_side) return {};
  pixels_ += static_cast<double>(size->x()) * size->y();
  if (pixels_ > kMaxScenePixels) return {};
  // Texture coordinates belong to the pixels as stored: glTF's viewers and Blender ignore EXIF orientations.
  return decode_image(bytes, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
}

cv::Mat SceneImages::of_file(const std::string& name) {
  const fs::path found = find_image(scene_file_, name);
  if (found.empty()) return {};
  if (const auto known = known_.find(found); known != known_.end()) return known->second;
  return known_[found] = of_bytes(read_file(found));
}

namespace {

/// An image file by its name, with or without the folder that the name has.
fs::path find_named_image(const fs::path& scene_file, const std::string& name) {
  const fs::path folder = scene_file.parent_path(), image(name);
  std::error_code none;
  std::vector<fs::path> candidates{folder / image, folder / image.filename()};
  for (const char* beside : {"textures", "Textures", "images", "tex"})
    candidates.push_back(folder / beside / image.filename());
  candidates.push_back(folder / scene_file.stem().concat(".fbm") / image.filename());
  for (const fs::path& candidate : candidates)
    if (fs::is_regular_file(candidate, none)) return candidate;
  return {};
}

/// The name that a URI stands for (RFC 3986): %20 is a blank.
std::string without_percents(const std::string& uri) {
  std::string name;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const std::string digits = uri[i] == '%' ? uri.substr(i + 1, 2) : "";
    const bool encoded = digits.size() == 2 && digits.find_first_not_of("0123456789abcdefABCDEF") == digits.npos;
    name += encoded ? static_cast<char>(std::stoi(digits, nullptr, 16)) : uri[i];
    if (encoded) i += 2;
  }
  return name;
}

fs::path find_tiled_image(const fs::path& scene_file, const std::string& name) {
  const std::optional<TileName> tiles = tile_name_of(name);
  if (!tiles || !tiles->is_pattern) return find_named_image(scene_file, name);
  constexpr int kRows = 2;  // of tiles, in which the first one is sought
  for (int tile = 0; tile < kTilesAlongU * kRows; ++tile)
    if (fs::path found = find_named_image(scene_file, tiles->of(tile % kTilesAlongU, tile / kTilesAlongU));
        !found.empty())
      return found;
  return {};
}

}  // namespace

fs::path find_image(const fs::path& scene_file, std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  if (name.rfind("file://", 0) == 0) name.erase(0, 7);
  if (name.empty()) return {};
  if (fs::path found = find_tiled_image(scene_file, name); !found.empty()) return found;
  return find_tiled_image(scene_file, without_percents(name));
}

}  // namespace doppel
