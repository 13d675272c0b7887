#include "doppel/io/scene/scene_mesh.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <unordered_map>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

constexpr int kPatch = 8;     // pixels of a patch of one colour
constexpr int kMaxTiles = 4;  // a texture that repeats is laid out at most so often along each side

/// Images side by side in one, each with a border of its own outermost pixels against bleeding.
class TextureAtlas {
 public:
  /// Images are made smaller, all by the same factor, until the atlas fits.
  /// @param images 8-bit BGR @param largest_side pixels
  /// @throws Error for so many images that even single pixels do not fit
  TextureAtlas(std::vector<cv::Mat> images, int largest_side);

  const cv::Mat& image() const { return image_; }
  /// The UV in the atlas of a UV in [0,1] of image `i`; u right, v up.
  Eigen::Vector2d atlas_uv(std::size_t i, const Eigen::Vector2d& uv) const;

 private:
  bool pack(const std::vector<cv::Mat>& images, int width, int largest_side);

  cv::Mat image_;
  std::vector<cv::Rect> rectangles_;
};

constexpr int kBorder = 4;

TextureAtlas::TextureAtlas(std::vector<cv::Mat> images, int largest_side) {
  const auto area = [&] {
    double sum = 0.0;
    for (const cv::Mat& image : images) sum += double(image.cols + 2 * kBorder) * (image.rows + 2 * kBorder);
    return sum;
  };
  for (;;) {
    int widest = 0;
    for (const cv::Mat& image : images) widest = std::max(widest, image.cols + 2 * kBorder);
    const int width = std::max(widest, static_cast<int>(std::ceil(std::sqrt(area()) * 1.1)));
    if (width <= largest_side && pack(images, width, largest_side)) break;
    const bool smallest = std::all_of(images.begin(), images.end(),
                                      [](const cv::Mat& image) { return image.cols == 1 && image.rows == 1; });
    if (smallest)
      fail("{} textures and colours do not fit into one image of {} x {} pixels; join materials before", images.size(),
           largest_side, largest_side);
    for (cv::Mat& image : images) {
      const cv::Size smaller(std::max(1, image.cols * 4 / 5), std::max(1, image.rows * 4 / 5));
      cv::Mat resized;
      cv::resize(image, resized, smaller, 0, 0, cv::INTER_AREA);
      image = resized;
    }
  }
  for (std::size_t i = 0; i < images.size(); ++i) {
    const cv::Rect& inside = rectangles_[i];
    cv::Mat bordered;
    cv::copyMakeBorder(images[i], bordered, kBorder, kBorder, kBorder, kBorder, cv::BORDER_REPLICATE);
    bordered.copyTo(image_(cv::Rect(inside.x - kBorder, inside.y - kBorder, bordered.cols, bordered.rows)));
  }
}

/// Rows of images, the highest first.
bool TextureAtlas::pack(const std::vector<cv::Mat>& images, int width, int largest_side) {
  std::vector<std::size_t> order(images.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return images[a].rows > images[b].rows; });
  rectangles_.assign(images.size(), cv::Rect());
  int x = 0, y = 0, row = 0;
  for (const std::size_t i : order) {
    const int w = images[i].cols + 2 * kBorder, h = images[i].rows + 2 * kBorder;
    if (x + w > width) {
      x = 0;
      y += row;
      row = 0;
    }
    rectangles_[i] = cv::Rect(x + kBorder, y + kBorder, images[i].cols, images[i].rows);
    x += w;
    row = std::max(row, h);
  }
  if (y + row > largest_side) return false;
  image_ = cv::Mat(y + row, width, CV_8UC3, cv::Scalar::all(0));
  return true;
}

Eigen::Vector2d TextureAtlas::atlas_uv(std::size_t i, const Eigen::Vector2d& uv) const {
  const cv::Rect& inside = rectangles_[i];
  const double x = inside.x + uv.x() * inside.width, y = inside.y + (1 - uv.y()) * inside.height;
  return {x / image_.cols, 1 - y / image_.rows};
}

int material_of(const ScenePrimitive& primitive, std::size_t face) {
  return primitive.face_materials.empty() ? primitive.material : primitive.face_materials[face];
}

/// What one material needs of the atlas.
struct MaterialUse {
  bool textured = false;
  Eigen::Vector2i low = Eigen::Vector2i::Zero(), high = Eigen::Vector2i::Ones();  ///< tiles of the texture
  bool moved = false;     ///< some triangles lie in another tile than [0,1]
  std::size_t image = 0;  ///< in the atlas

  bool repeats() const { return moved || low != Eigen::Vector2i::Zero() || high != Eigen::Vector2i::Ones(); }
};

/// The whole tiles by which the UVs of a triangle are moved, so that its middle lies in [0,1).
Eigen::Vector2d tile_of(const ScenePrimitive& primitive, std::size_t face) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const int uv : primitive.face_uvs[face]) middle += primitive.uvs[uv] / 3;
  return {std::floor(middle.x()), std::floor(middle.y())};
}

/// Joins the surfaces of a scene: vertices, faces, colours, and one texture.
class MeshJoiner {
 public:
  MeshJoiner(const Scene& scene, std::vector<Eigen::Vector3d> vertices, const SceneMeshOptions& options)
      : scene_(scene), options_(options) {
    mesh_.vertices = std::move(vertices);
  }

  TriangleMesh join() {
    int first = 0;
    for (const ScenePrimitive& primitive : scene_.primitives) {
      for (Triangle face : primitive.faces) {
        for (int& corner : face) corner += first;
        mesh_.faces.push_back(face);
      }
      first += primitive.num_vertices();
    }
    if (as_size(first) != mesh_.vertices.size())
      fail("the scene has {} vertices, but {} positions are given", first, mesh_.vertices.size());
    find_uses();
    join_colours();
    if (!any_texture_) return std::move(mesh_);
    if (single_texture())
      keep_uvs();
    else
      join_textures();
    return std::move(mesh_);
  }

 private:
  const SceneMaterial& material(int index) const {
    static const SceneMaterial kNone{"", Eigen::Vector4d(0.8, 0.8, 0.8, 1), {}};
    return index < 0 ? kNone : scene_.materials[index];
  }
  void find_uses();
  bool single_texture() const {
    return uses_.size() == 1 && uses_.begin()->second.textured && !uses_.begin()->second.repeats() &&
           std::all_of(scene_.primitives.begin(), scene_.primitives.end(), [](const ScenePrimitive& primitive) {
             return primitive.faces.empty() || !primitive.face_uvs.empty();
           });
  }
  void join_colours();
  void keep_uvs();
  void join_textures();
  cv::Mat image_of(int index, const MaterialUse& use) const;

  const Scene& scene_;
  SceneMeshOptions options_;
  TriangleMesh mesh_;
  std::map<int, MaterialUse> uses_;
  bool any_texture_ = false;
};

void MeshJoiner::find_uses() {
  for (const ScenePrimitive& primitive : scene_.primitives)
    for (std::size_t f = 0; f < primitive.faces.size(); ++f) {
      const int index = material_of(primitive, f);
      MaterialUse& use = uses_[index];
      if (material(index).texture.empty() || primitive.face_uvs.empty()) continue;
      use.textured = any_texture_ = true;
      const Eigen::Vector2d tile = tile_of(primitive, f);
      use.moved = use.moved || !tile.isZero();
      const cv::Mat& texture = material(index).texture;
      for (const int uv : primitive.face_uvs[f]) {
        const Eigen::Vector2d at = primitive.uvs[uv] - tile;
        for (int axis = 0; axis < 2; ++axis) {
          // Less than half a texel beyond the border is the border's texel.
          const double slack = 0.5 / (axis == 0 ? texture.cols : texture.rows);
          const double low = std::clamp(std::floor(at[axis] + slack), -double(kMaxTiles), 0.0);
          const double high = std::clamp(std::ceil(at[axis] - slack), 1.0, double(kMaxTiles));
          use.low[axis] = std::min(use.low[axis], static_cast<int>(low));
          use.high[axis] = std::max(use.high[axis], static_cast<int>(high));
        }
      }
    }
}

/// Colours of vertices where the file has them, or where materials differ and none has a texture.
void MeshJoiner::join_colours() {
  const bool given = std::any_of(scene_.primitives.begin(), scene_.primitives.end(),
                                 [](const ScenePrimitive& primitive) { return !primitive.colours.empty(); });
  if (!given && (any_texture_ || uses_.size() < 2)) return;
  for (const ScenePrimitive& primitive : scene_.primitives) {
    const std::size_t first = mesh_.colours.size();
    if (!primitive.colours.empty()) {
      mesh_.colours.insert(mesh_.colours.end(), primitive.colours.begin(), primitive.colours.end());
      continue;
    }
    mesh_.colours.resize(first + primitive.vertices.size(), material(primitive.material).colour.head<3>());
    for (std::size_t f = 0; f < primitive.face_materials.size(); ++f)
      for (const int vertex : primitive.faces[f])
        mesh_.colours[first + as_size(vertex)] = material(primitive.face_materials[f]).colour.head<3>();
  }
}

void MeshJoiner::keep_uvs() {
  for (const ScenePrimitive& primitive : scene_.primitives) {
    const int first = static_cast<int>(mesh_.uvs.size());
    mesh_.uvs.insert(mesh_.uvs.end(), primitive.uvs.begin(), primitive.uvs.end());
    for (Triangle face : primitive.face_uvs) {
      for (int& uv : face) uv += first;
      mesh_.face_uvs.push_back(face);
    }
  }
  mesh_.texture = image_of(uses_.begin()->first, MaterialUse{true});
}

/// A texture, repeated as often as it is needed and in the colour of the material; or a patch of that colour.
cv::Mat MeshJoiner::image_of(int index, const MaterialUse& use) const {
  const SceneMaterial& from = material(index);
  const cv::Scalar colour(from.colour[2], from.colour[1], from.colour[0]);
  if (!use.textured) return cv::Mat(kPatch, kPatch, CV_8UC3, 255 * colour);
  cv::Mat image = coloured_texture(from);
  const Eigen::Vector2i tiles = use.high - use.low;
  if (tiles == Eigen::Vector2i::Ones()) return image;
  // All tiles together become no larger than the atlas may be.
  const double shrink = std::min({1.0, double(options_.atlas_side) / (double(tiles.x()) * image.cols),
                                  double(options_.atlas_side) / (double(tiles.y()) * image.rows)});
  const cv::Size size(std::max(1, static_cast<int>(shrink * image.cols)),
                      std::max(1, static_cast<int>(shrink * image.rows)));
  cv::Mat tile = image;
  if (size != image.size()) cv::resize(image, tile, size, 0, 0, cv::INTER_AREA);
  return cv::repeat(tile, tiles.y(), tiles.x());
}

void MeshJoiner::join_textures() {
  std::vector<cv::Mat> images;
  for (auto& [index, use] : uses_) {
    use.image = images.size();
    images.push_back(image_of(index, use));
  }
  const TextureAtlas atlas(std::move(images), options_.atlas_side);
  for (const ScenePrimitive& primitive : scene_.primitives) {
    // One UV of the atlas for each UV, tile and material of the primitive.
    std::map<std::array<int, 4>, int> known;
    for (std::size_t f = 0; f < primitive.faces.size(); ++f) {
      const MaterialUse& use = uses_.at(material_of(primitive, f));
      const bool textured = use.textured && !primitive.face_uvs.empty();
      const Eigen::Vector2d tile = textured ? tile_of(primitive, f) : Eigen::Vector2d::Zero();
      Triangle face{};
      for (std::size_t c = 0; c < 3; ++c) {
        const int uv = textured ? primitive.face_uvs[f][c] : -1;
        const auto [entry, added] =
            known.try_emplace({uv, static_cast<int>(std::clamp(tile.x(), -1e9, 1e9)),
                               static_cast<int>(std::clamp(tile.y(), -1e9, 1e9)), static_cast<int>(use.image)},
                              static_cast<int>(mesh_.uvs.size()));
        if (added) {
          Eigen::Vector2d at(0.5, 0.5);
          if (textured)
            at = (primitive.uvs[uv] - tile - use.low.cast<double>()).cwiseQuotient((use.high - use.low).cast<double>());
          mesh_.uvs.push_back(atlas.atlas_uv(use.image, at.cwiseMax(0.0).cwiseMin(1.0)));
        }
        face[c] = entry->second;
      }
      mesh_.face_uvs.push_back(face);
    }
  }
  mesh_.texture = atlas.image();
}

}  // namespace

TriangleMesh scene_mesh(const Scene& scene, std::vector<Eigen::Vector3d> vertices, const SceneMeshOptions& options) {
  return MeshJoiner(scene, std::move(vertices), options).join();
}

TriangleMesh scene_mesh(const Scene& scene, const SceneMeshOptions& options) {
  return scene_mesh(scene, posed_vertices(scene, node_transforms(scene)), options);
}

}  // namespace doppel
