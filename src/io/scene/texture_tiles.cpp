#include "doppel/io/scene/texture_tiles.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/io/scene/scene_images.h"

namespace doppel {

namespace {

constexpr int kFirstUdim = 1001, kLastUdim = kFirstUdim + kTilesAlongU * kTilesAlongV - 1;
constexpr std::size_t kUdimDigits = 4;

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// Where a word stands in a text, without regard to the case.
std::size_t find_word(std::string_view text, std::string_view word) {
  const auto found = std::search(text.begin(), text.end(), word.begin(), word.end(),
                                 [](unsigned char a, unsigned char b) { return std::tolower(a) == std::tolower(b); });
  return found == text.end() ? text.npos : static_cast<std::size_t>(found - text.begin());
}

std::optional<TileName> pattern_of(std::string_view name) {
  for (const auto& [word, numbering] : {std::pair("<udim>", TileName::Numbering::udim),
                                        {"%(udim)d", TileName::Numbering::udim},
                                        {"<uvtile>", TileName::Numbering::from_one}})
    if (const std::size_t at = find_word(name, word); at != name.npos)
      return TileName{std::string(name.substr(0, at)), std::string(name.substr(at + std::string_view(word).size())),
                      numbering, true};
  return std::nullopt;
}

/// The last four digits that stand alone and are the number of a tile.
std::optional<TileName> udim_of(std::string_view name, std::size_t file) {
  for (std::size_t end = name.size(); end > file;) {
    if (!is_digit(name[end - 1])) {
      --end;
      continue;
    }
    std::size_t begin = end;
    while (begin > file && is_digit(name[begin - 1])) --begin;
    const bool is_number = end - begin == kUdimDigits;
    const int number = is_number ? std::stoi(std::string(name.substr(begin, kUdimDigits))) : 0;
    if (number >= kFirstUdim && number <= kLastUdim)
      return TileName{std::string(name.substr(0, begin)), std::string(name.substr(end))};
    end = begin;
  }
  return std::nullopt;
}

/// `u<number>_v<number>` in the name of the file.
std::optional<TileName> uv_tile_of(std::string_view name, std::size_t file) {
  const auto digits = [&](std::size_t at) {
    std::size_t end = at;
    while (end < name.size() && end < at + 2 && is_digit(name[end])) ++end;
    return end;
  };
  for (std::size_t at = file; at + 4 < name.size(); ++at) {
    const bool starts = at == file || std::isalnum(static_cast<unsigned char>(name[at - 1])) == 0;
    if (!starts || std::tolower(static_cast<unsigned char>(name[at])) != 'u') continue;
    const std::size_t u_end = digits(at + 1);
    if (u_end == at + 1 || find_word(name.substr(u_end, 2), "_v") != 0) continue;
    const std::size_t v_end = digits(u_end + 2);
    if (v_end == u_end + 2) continue;
    const bool zero = name.substr(at + 1, u_end - at - 1) == "0" || name.substr(u_end + 2, v_end - u_end - 2) == "0";
    return TileName{std::string(name.substr(0, at)), std::string(name.substr(v_end)),
                    zero ? TileName::Numbering::from_zero : TileName::Numbering::from_one};
  }
  return std::nullopt;
}

using Tile = std::pair<int, int>;

/// The tile in which the middle of a face lies; nothing beyond the tiles that there are.
std::optional<Tile> tile_of_face(const ScenePrimitive& primitive, std::size_t face) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const int uv : primitive.face_uvs[face]) middle += primitive.uvs[uv] / 3;
  if (!(middle.minCoeff() >= 0) || !(middle.x() < kTilesAlongU) || !(middle.y() < kTilesAlongV)) return std::nullopt;
  return Tile(static_cast<int>(middle.x()), static_cast<int>(middle.y()));
}

/// Spreads the materials of one scene.
class TileSpreader {
 public:
  TileSpreader(const std::filesystem::path& path, Scene& scene, const SceneLimits& limits)
      : path_(path), scene_(scene), images_(path, limits) {}

  void spread() {
    const std::size_t count = scene_.materials.size();
    std::vector<std::optional<TileName>> names(count);
    for (std::size_t m = 0; m < count; ++m) names[m] = tile_name_of(scene_.materials[m].texture_file);
    if (std::none_of(names.begin(), names.end(), [](const auto& name) { return name.has_value(); })) return;
    std::vector<std::map<Tile, int>> materials(count);  // the material of each tile that is used
    for_each_face([&](ScenePrimitive&, std::size_t, int material, const Tile& tile) {
      if (names[material]) materials[material].emplace(tile, material);
    });
    for (std::size_t m = 0; m < count; ++m)
      if (names[m]) give_images(static_cast<int>(m), *names[m], materials[m]);
    for_each_face([&](ScenePrimitive& primitive, std::size_t face, int material, const Tile& tile) {
      if (as_size(material) >= count) return;
      const auto own = materials[material].find(tile);
      if (own == materials[material].end() || own->second == material) return;
      if (primitive.face_materials.empty()) primitive.face_materials.assign(primitive.faces.size(), material);
      primitive.face_materials[face] = own->second;
    });
  }

 private:
  /// Calls `visit` for the faces that have a material and a tile.
  template <typename Visit>
  void for_each_face(const Visit& visit) {
    for (ScenePrimitive& primitive : scene_.primitives)
      for (std::size_t f = 0; f < primitive.face_uvs.size(); ++f) {
        const int material = primitive.face_materials.empty() ? primitive.material : primitive.face_materials[f];
        if (material < 0) continue;
        if (const auto tile = tile_of_face(primitive, f)) visit(primitive, f, material, *tile);
      }
  }

  bool exists(const TileName& name, const Tile& tile) const {
    return !find_image(path_, name.of(tile.first, tile.second)).empty();
  }

  /// Replaces the material of each tile by one with its image; the first tile keeps the material itself.
  void give_images(int material, const TileName& name, std::map<Tile, int>& materials) {
    const std::string written = scene_.materials[material].texture_file;
    // The number of a single image may be a year or a size: then it repeats.
    const bool is_set = name.is_pattern || std::any_of(materials.begin(), materials.end(), [&](const auto& entry) {
                          return name.of(entry.first.first, entry.first.second) != written && exists(name, entry.first);
                        });
    if (!is_set) return;
    const SceneMaterial original = scene_.materials[material];
    bool first = true;
    for (auto& [tile, index] : materials) {
      SceneMaterial own = original;
      own.texture_file = name.of(tile.first, tile.second);
      own.texture = images_.of_file(own.texture_file);
      if (own.texture.empty())
        scene_.warnings.push_back(
            fmt::format("the tile '{}' of the texture of material '{}' is missing or cannot be decoded; its colour is "
                        "used",
                        own.texture_file.substr(0, 80), original.name.substr(0, 80)));
      if (first) {
        scene_.materials[material] = std::move(own);
      } else {
        own.name += fmt::format("_{}_{}", tile.first, tile.second);
        index = static_cast<int>(scene_.materials.size());
        scene_.materials.push_back(std::move(own));
      }
      first = false;
    }
  }

  const std::filesystem::path& path_;
  Scene& scene_;
  SceneImages images_;
};

}  // namespace

std::string TileName::of(int u, int v) const {
  const int first = numbering == Numbering::from_one ? 1 : 0;
  return before +
         (numbering == Numbering::udim ? std::to_string(kFirstUdim + u + kTilesAlongU * v)
                                       : fmt::format("u{}_v{}", u + first, v + first)) +
         after;
}

std::optional<TileName> tile_name_of(std::string_view name) {
  const std::size_t slash = name.find_last_of("/\\");
  const std::size_t file = slash == name.npos ? 0 : slash + 1;
  if (auto pattern = pattern_of(name)) return pattern;
  if (auto tile = uv_tile_of(name, file)) return tile;
  return udim_of(name, file);
}

void spread_tiles(const std::filesystem::path& path, Scene& scene, const SceneLimits& limits) {
  TileSpreader(path, scene, limits).spread();
}

}  // namespace doppel
