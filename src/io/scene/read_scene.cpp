#include "doppel/io/scene/read_scene.h"

#include "doppel/core/error.h"
#include "doppel/core/file_head.h"
#include "doppel/core/lower_case.h"
#include "doppel/io/scene/finish_scene.h"
#include "doppel/io/scene/readers.h"
#include "doppel/io/scene/texture_tiles.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// The extension that the first bytes of the file call for; that of its name where they say nothing.
std::string format_of(const fs::path& path) {
  const std::string start = read_head(path, 24);
  if (start.rfind("glTF", 0) == 0) return ".glb";
  if (start.rfind("Kaydara FBX Binary", 0) == 0 || start.rfind("; FBX", 0) == 0) return ".fbx";
  return lower_case(path.extension().string());
}

Scene read_format(const fs::path& path, const SceneLimits& limits) {
  const std::string format = format_of(path);
  if (format == ".gltf" || format == ".glb" || format == ".vrm") return read_gltf(path, limits);
  if (format == ".fbx") return read_fbx(path, limits);
  if (format == ".dae") return read_collada(path, limits);
  if (format == ".stl") return read_stl(path, limits);
  if (format == ".ply") return read_ply(path, limits);
  if (format == ".obj") return read_obj_scene(path, limits);
  fail_at({path.string(), 0},
          "'{}' is not a format of surfaces that is read; glTF (.gltf, .glb, .vrm), FBX (.fbx), Collada (.dae), STL, "
          "PLY and OBJ are",
          format);
}

}  // namespace

Scene read_scene(const fs::path& path, const SceneLimits& limits) {
  std::error_code none;
  if (!fs::is_regular_file(path, none)) fail_at({path.string(), 0}, "there is no such file");
  Scene scene = read_format(path, limits);
  finish_scene(path, scene, limits);
  spread_tiles(path, scene, limits);
  return scene;
}

}  // namespace doppel
