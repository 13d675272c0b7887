#include "doppel/io/scene/texture_tiles.h"

#include <map>
#include <optional>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/io/scene/scene_images.h"
#include "doppel/io/scene/tile_name.h"

namespace doppel {

namespace {

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

void spread_tiles(const std::filesystem::path& path, Scene& scene, const SceneLimits& limits) {
  TileSpreader(path, scene, limits).spread();
}

}  // namespace doppel
