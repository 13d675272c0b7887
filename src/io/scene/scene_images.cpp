#include "doppel/io/scene/scene_images.h"

#include <algorithm>
#include <array>
#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "doppel/core/atomic_file.h"
#include "doppel/io/scene/tile_name.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr double kMaxPixels = 5.4e8;  // of all images of a scene: 1.6 GB

/// A whole number of the bytes; 0 beyond their end.
std::uint64_t number_at(std::string_view bytes, std::size_t at, std::size_t width, bool big_endian) {
  if (width > bytes.size() || at > bytes.size() - width) return 0;
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < width; ++i)
    value = value << 8 | static_cast<unsigned char>(bytes[at + (big_endian ? i : width - 1 - i)]);
  return value;
}

Eigen::Vector2i size_of(std::uint64_t width, std::uint64_t height) {
  constexpr std::uint64_t kMaxSide = 1 << 30;
  return {static_cast<int>(std::min(width, kMaxSide)), static_cast<int>(std::min(height, kMaxSide))};
}

/// The frame header (SOF) of a JPEG file behind its other segments.
std::optional<Eigen::Vector2i> jpeg_size(std::string_view bytes) {
  for (std::size_t at = 2; at + 9 <= bytes.size();) {
    if (bytes[at] != '\xFF') return std::nullopt;
    const auto kind = static_cast<unsigned char>(bytes[at + 1]);
    if (kind == 0xFF) {
      ++at;  // padding
    } else if (kind >= 0xC0 && kind <= 0xCF && kind != 0xC4 && kind != 0xC8 && kind != 0xCC) {
      return size_of(number_at(bytes, at + 7, 2, true), number_at(bytes, at + 5, 2, true));
    } else {
      at += 2 + number_at(bytes, at + 2, 2, true);
    }
  }
  return std::nullopt;
}

std::optional<Eigen::Vector2i> webp_size(std::string_view bytes) {
  const std::string_view form = bytes.substr(12, 4);
  if (form == "VP8X") return size_of(number_at(bytes, 24, 3, false) + 1, number_at(bytes, 27, 3, false) + 1);
  if (form == "VP8 ") return size_of(number_at(bytes, 26, 2, false) & 0x3FFF, number_at(bytes, 28, 2, false) & 0x3FFF);
  if (form != "VP8L") return std::nullopt;
  const std::uint64_t bits = number_at(bytes, 21, 4, false);
  return size_of((bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1);
}

/// Width and height are the tags 256 and 257 of the first list of tags.
std::optional<Eigen::Vector2i> tiff_size(std::string_view bytes) {
  const bool big = bytes[0] == 'M';
  const std::size_t list = number_at(bytes, 4, 4, big), count = number_at(bytes, list, 2, big);
  std::array<std::uint64_t, 2> found{};
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t entry = list + 2 + 12 * i, tag = number_at(bytes, entry, 2, big);
    if (tag == 256 || tag == 257)
      found[tag - 256] = number_at(bytes, entry + 8, number_at(bytes, entry + 2, 2, big) == 3 ? 2 : 4, big);
  }
  return size_of(found[0], found[1]);
}

}  // namespace

std::optional<Eigen::Vector2i> announced_image_size(const std::string& bytes) {
  if (bytes.size() < 30) return std::nullopt;
  const std::string_view view = bytes;
  if (view.substr(0, 8) == "\x89PNG\r\n\x1a\n")
    return size_of(number_at(view, 16, 4, true), number_at(view, 20, 4, true));
  if (view.substr(0, 2) == "\xFF\xD8") return jpeg_size(view);
  if (view.substr(0, 4) == "RIFF" && view.substr(8, 4) == "WEBP") return webp_size(view);
  if (view.substr(0, 4) == std::string_view("II*\0", 4) || view.substr(0, 4) == std::string_view("MM\0*", 4))
    return tiff_size(view);
  if (view.substr(0, 2) != "BM") return std::nullopt;
  // The height of a BMP image is negative where its first row is the upper one.
  const auto height = static_cast<std::int32_t>(number_at(view, 22, 4, false));
  return size_of(number_at(view, 18, 4, false),
                 static_cast<std::uint64_t>(std::abs(static_cast<std::int64_t>(height))));
}

cv::Mat SceneImages::of_bytes(const std::string& bytes) {
  const auto size = announced_image_size(bytes);
  if (!size || bytes.size() > (std::size_t{1} << 30) || size->minCoeff() < 1 || size->maxCoeff() > limits_.image_side)
    return {};
  pixels_ += static_cast<double>(size->x()) * size->y();
  if (pixels_ > kMaxPixels) return {};
  const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
  try {
    // Texture coordinates belong to the pixels as stored: glTF's viewers and Blender ignore EXIF orientations.
    return cv::imdecode(encoded, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    return {};  // an image that its decoder rejects counts as missing; the caller warns
  }
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

}  // namespace

fs::path find_image(const fs::path& scene_file, std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  for (std::size_t at = name.find("%20"); at != std::string::npos; at = name.find("%20")) name.replace(at, 3, " ");
  if (name.rfind("file://", 0) == 0) name.erase(0, 7);
  if (name.empty()) return {};
  const std::optional<TileName> tiles = tile_name_of(name);
  if (!tiles || !tiles->is_pattern) return find_named_image(scene_file, name);
  constexpr int kRows = 2;  // of tiles, in which the first one is sought
  for (int tile = 0; tile < kTilesAlongU * kRows; ++tile)
    if (fs::path found = find_named_image(scene_file, tiles->of(tile % kTilesAlongU, tile / kTilesAlongU));
        !found.empty())
      return found;
  return {};
}

}  // namespace doppel
