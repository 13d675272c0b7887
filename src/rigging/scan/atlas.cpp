#include "doppel/rigging/scan/atlas.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "doppel/core/error.h"
#include "doppel/rigging/scan/edge_table.h"

namespace doppel {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Box2 = Eigen::AlignedBox2d;

constexpr double kBleed = 0.02;  // UVs this little beyond a tile belong to it
constexpr int kPlainSize = 4;    // pixels of the patch of a plain colour
constexpr int kPackRounds = 12;

/// The UVs of a part after islands were moved by whole tiles.
struct TiledUvs {
  std::vector<Vector2d> uvs;
  std::vector<Triangle> face_uvs;
  Box2 window;         ///< of all UVs in use
  bool moved = false;  ///< some left their position by whole tiles
  bool cut = false;    ///< islands were cut at tiles
};

/// Moves islands into the first tile. An island over more tiles than allowed is moved face by face.
class TileMover {
 public:
  TileMover(const TriangleMesh& mesh, int most_repeats) : mesh_(mesh), most_repeats_(most_repeats) {}

  TiledUvs run() {
    JoinedSets sets(mesh_.uvs.size());
    for (const Triangle& face : mesh_.face_uvs) {
      sets.join(face[0], face[1]);
      sets.join(face[0], face[2]);
    }
    std::vector<Box2> boxes(mesh_.uvs.size());
    for (const Triangle& face : mesh_.face_uvs)
      for (const int uv : face) boxes[sets.find(uv)].extend(mesh_.uvs[uv]);
    for (const Triangle& face : mesh_.face_uvs) {
      const Box2& island = boxes[sets.find(face[0])];
      const bool small = island.sizes().maxCoeff() <= most_repeats_;
      if (small) {
        add_face(face, tile_of(island));
        continue;
      }
      Box2 box;
      for (const int uv : face) box.extend(mesh_.uvs[uv]);
      add_face(face, tile_of(box));
      out_.cut = true;
    }
    return std::move(out_);
  }

 private:
  static Vector2d tile_of(const Box2& box) { return (box.min().array() + kBleed).floor(); }

  void add_face(const Triangle& face, const Vector2d& tile) {
    Triangle moved;
    for (int k = 0; k < 3; ++k) {
      const auto [entry, fresh] =
          positions_.emplace(std::tuple(face[k], tile.x(), tile.y()), static_cast<int>(out_.uvs.size()));
      if (fresh) {
        out_.uvs.emplace_back(mesh_.uvs[face[k]] - tile);
        out_.window.extend(out_.uvs.back());
      }
      moved[k] = entry->second;
    }
    out_.moved = out_.moved || !tile.isZero();
    out_.face_uvs.push_back(moved);
  }

  const TriangleMesh& mesh_;
  int most_repeats_;
  TiledUvs out_;
  std::map<std::tuple<int, double, double>, int> positions_;
};

cv::Mat as_bgr(const cv::Mat& image, const std::string& name) {
  cv::Mat bytes = image;
  if (image.depth() == CV_16U)
    image.convertTo(bytes, CV_8U, 1.0 / 257.0);
  else if (image.depth() == CV_32F)
    image.convertTo(bytes, CV_8U, 255.0);
  else if (image.depth() != CV_8U)
    fail<UsageError>("joining the parts of the scan: the texture of {} has an unknown pixel type; use 8-bit images",
                     name);
  cv::Mat bgr = bytes;
  if (bytes.channels() == 1) cv::cvtColor(bytes, bgr, cv::COLOR_GRAY2BGR);
  if (bytes.channels() == 4) cv::cvtColor(bytes, bgr, cv::COLOR_BGRA2BGR);
  return bgr;
}

/// A rectangle of the atlas: a window of a texture, or a plain colour.
struct Patch {
  cv::Mat texture;  ///< 8-bit BGR; empty: plain
  Vector3d colour;
  Box2 window;        ///< UV, may exceed 0..1
  cv::Rect source;    ///< pixels of the repeated texture
  cv::Rect position;  ///< in the atlas, without margin

  bool repeats() const {
    return source.x < 0 || source.y < 0 || source.br().x > texture.cols || source.br().y > texture.rows;
  }

  void find_source() {
    if (texture.empty()) {
      source = {0, 0, kPlainSize, kPlainSize};
      return;
    }
    const auto down = [](double value, int size) { return static_cast<int>(std::floor(value * size + 1e-6)); };
    const auto up = [](double value, int size) { return static_cast<int>(std::ceil(value * size - 1e-6)); };
    const int left = down(window.min().x(), texture.cols), right = up(window.max().x(), texture.cols);
    const int top = down(1.0 - window.max().y(), texture.rows), bottom = up(1.0 - window.min().y(), texture.rows);
    source = {left, top, std::max(1, right - left), std::max(1, bottom - top)};
  }

  /// The window's pixels with `margin` more on each side.
  cv::Mat pixels(int margin) const {
    const cv::Rect wanted(source.x - margin, source.y - margin, source.width + 2 * margin, source.height + 2 * margin);
    if (texture.empty()) return {wanted.size(), CV_8UC3, cv::Scalar(colour.z(), colour.y(), colour.x()) * 255.0};
    const bool wrap = repeats();
    const auto pick = [&](int at, int size) {
      return wrap ? ((at % size) + size) % size : std::clamp(at, 0, size - 1);
    };
    cv::Mat out(wanted.size(), CV_8UC3);
    for (int y = 0; y < out.rows; ++y) {
      const cv::Vec3b* row = texture.ptr<cv::Vec3b>(pick(wanted.y + y, texture.rows));
      for (int x = 0; x < out.cols; ++x) out.at<cv::Vec3b>(y, x) = row[pick(wanted.x + x, texture.cols)];
    }
    return out;
  }

  /// From a moved UV to the atlas.
  Vector2d map(const Vector2d& uv, const cv::Size& atlas) const {
    Vector2d pixel(position.x + 0.5 * position.width, position.y + 0.5 * position.height);
    if (!texture.empty()) {
      pixel.x() = position.x + (uv.x() * texture.cols - source.x) * position.width / source.width;
      pixel.y() = position.y + ((1.0 - uv.y()) * texture.rows - source.y) * position.height / source.height;
    }
    return {pixel.x() / atlas.width, 1.0 - pixel.y() / atlas.height};
  }
};

/// Sets the positions of all patches, row by row. @return the size of the atlas
cv::Size pack(std::vector<Patch>& patches, int margin, double scale) {
  double area = 0.0;
  int widest = 0;
  for (Patch& patch : patches) {
    const double own = patch.texture.empty() ? 1.0 : scale;
    patch.position.width = std::max(1, static_cast<int>(std::lround(patch.source.width * own)));
    patch.position.height = std::max(1, static_cast<int>(std::lround(patch.source.height * own)));
    const int width = patch.position.width + 2 * margin;
    area += static_cast<double>(width) * (patch.position.height + 2 * margin);
    widest = std::max(widest, width);
  }
  const int limit = std::max(widest, static_cast<int>(std::ceil(std::sqrt(area))));
  std::vector<std::size_t> order(patches.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return patches[a].position.height > patches[b].position.height;
  });
  int x = 0, y = 0, row = 0, width = 0;
  for (const std::size_t i : order) {
    cv::Rect& position = patches[i].position;
    if (x > 0 && x + position.width + 2 * margin > limit) {
      y += row;
      x = row = 0;
    }
    position.x = x + margin;
    position.y = y + margin;
    x += position.width + 2 * margin;
    row = std::max(row, position.height + 2 * margin);
    width = std::max(width, x);
  }
  return {width, y + row};
}

class PartMerger {
 public:
  PartMerger(const ScanParts& scan, const AtlasOptions& options) : scan_(scan), options_(options) { check(); }

  MergedScan run() {
    join_surfaces();
    if (std::any_of(scan_.parts.begin(), scan_.parts.end(), textured)) join_textures();
    return std::move(out_);
  }

 private:
  static bool textured(const ScanPart& part) { return !part.mesh.texture.empty() && !part.mesh.face_uvs.empty(); }

  void check() const {
    if (scan_.parts.empty())
      fail<UsageError>("joining the parts of the scan: the file holds no surface; export the scan as a mesh");
    long faces = 0;
    for (const ScanPart& part : scan_.parts) {
      check_scan_mesh(part.mesh, fmt::format("joining the parts of the scan: {}", part.name));
      faces += part.mesh.num_faces();
      for (const Vector2d& uv : part.mesh.uvs)
        if (!uv.allFinite())
          fail<UsageError>(
              "joining the parts of the scan: {} has a texture coordinate that is not finite; export the scan again",
              part.name);
    }
    if (faces > kMaxScanTriangles)
      fail<UsageError>(
          "joining the parts of the scan: found {} triangles, at most {} are allowed; reduce the scan in the scanning "
          "program first (decimate it, for example to 2 million)",
          faces, kMaxScanTriangles);
    if (options_.largest_size < 16 || options_.margin < 0 || options_.most_repeats < 1)
      fail<UsageError>("joining the parts of the scan: atlas size {}, margin {} and repeats {} must be positive",
                       options_.largest_size, options_.margin, options_.most_repeats);
  }

  bool has_colours() const {
    const auto& parts = scan_.parts;
    if (std::any_of(parts.begin(), parts.end(), [](const ScanPart& p) { return !p.mesh.colours.empty(); })) return true;
    if (std::any_of(parts.begin(), parts.end(), textured)) return false;
    return std::any_of(parts.begin(), parts.end(), [&](const ScanPart& p) { return p.colour != parts[0].colour; });
  }

  void join_surfaces() {
    const bool colours = has_colours();
    for (const ScanPart& part : scan_.parts) {
      const int first = out_.mesh.num_vertices();
      out_.first_face.push_back(out_.mesh.num_faces());
      out_.mesh.vertices.insert(out_.mesh.vertices.end(), part.mesh.vertices.begin(), part.mesh.vertices.end());
      for (const Triangle& face : part.mesh.faces)
        out_.mesh.faces.push_back({face[0] + first, face[1] + first, face[2] + first});
      if (!colours) continue;
      const std::vector<Vector3d> own = part.mesh.colours.empty() ? sampled_colours(part) : part.mesh.colours;
      out_.mesh.colours.insert(out_.mesh.colours.end(), own.begin(), own.end());
    }
    out_.first_face.push_back(out_.mesh.num_faces());
  }

  /// The texture at each vertex, or the part's colour.
  static std::vector<Vector3d> sampled_colours(const ScanPart& part) {
    std::vector<Vector3d> colours(part.mesh.vertices.size(), part.colour);
    if (!textured(part)) return colours;
    const cv::Mat texture = as_bgr(part.mesh.texture, part.name);
    for (std::size_t f = 0; f < part.mesh.faces.size(); ++f)
      for (int k = 0; k < 3; ++k) {
        const Vector2d& uv = part.mesh.uvs[part.mesh.face_uvs[f][k]];
        const double u = uv.x() - std::floor(uv.x()), v = uv.y() - std::floor(uv.y());
        const cv::Vec3b pixel =
            texture.at<cv::Vec3b>(std::min(texture.rows - 1, static_cast<int>((1.0 - v) * texture.rows)),
                                  std::min(texture.cols - 1, static_cast<int>(u * texture.cols)));
        colours[part.mesh.faces[f][k]] = Vector3d(pixel[2], pixel[1], pixel[0]) / 255.0;
      }
    return colours;
  }

  void join_textures() {
    for (std::size_t p = 0; p < scan_.parts.size(); ++p) tile(scan_.parts[p]);
    for (Patch& patch : patches_) patch.find_source();
    limit_repeats();
    if (keep_as_is()) return;
    const cv::Size size = fit();
    cv::Mat atlas(size, CV_8UC3, cv::Scalar::all(0));
    for (const Patch& patch : patches_) paint(patch, atlas);
    out_.mesh.texture = atlas;
    for (std::size_t p = 0; p < scan_.parts.size(); ++p) {
      const int first = static_cast<int>(out_.mesh.uvs.size());
      for (const Vector2d& uv : tiled_[p].uvs) out_.mesh.uvs.push_back(patches_[patch_of_[p]].map(uv, size));
      for (const Triangle& face : tiled_[p].face_uvs)
        out_.mesh.face_uvs.push_back({face[0] + first, face[1] + first, face[2] + first});
    }
    if (scan_.parts.size() > 1 || patches_.size() > 1)
      out_.notes.push_back(fmt::format("{} textures and colours of {} parts joined in one image of {} x {} pixels.",
                                       patches_.size(), scan_.parts.size(), size.width, size.height));
  }

  void tile(const ScanPart& part) {
    if (!textured(part)) {
      TiledUvs plain;
      plain.uvs.emplace_back(Vector2d::Zero());
      plain.face_uvs.assign(part.mesh.faces.size(), Triangle{0, 0, 0});
      tiled_.push_back(std::move(plain));
      patch_of_.push_back(patches_.size());
      Vector3d colour = part.colour;
      if (!part.mesh.colours.empty()) {
        colour = std::accumulate(part.mesh.colours.begin(), part.mesh.colours.end(), Vector3d(Vector3d::Zero())) /
                 static_cast<double>(part.mesh.colours.size());
        out_.notes.push_back(
            fmt::format("{} has colours per vertex while other parts have textures: the texture shows its mean colour.",
                        part.name));
      }
      patches_.push_back({cv::Mat(), colour, Box2(), {}, {}});
      return;
    }
    tiled_.push_back(TileMover(part.mesh, options_.most_repeats).run());
    if (tiled_.back().cut)
      out_.notes.push_back(fmt::format("{} repeats its texture more than {} times: cut at the repeats.", part.name,
                                       options_.most_repeats));
    // Parts with the same image share a patch.
    const auto known = textures_.find(part.mesh.texture.data);
    if (known != textures_.end()) {
      patch_of_.push_back(known->second);
      patches_[known->second].window.extend(tiled_.back().window);
      return;
    }
    textures_[part.mesh.texture.data] = patches_.size();
    patch_of_.push_back(patches_.size());
    patches_.push_back({as_bgr(part.mesh.texture, part.name), part.colour, tiled_.back().window, {}, {}});
  }

  /// A single face over too many repeats: its texture is made smaller before it is repeated.
  void limit_repeats() {
    for (Patch& patch : patches_) {
      if (patch.texture.empty()) continue;
      const double repeats = patch.window.sizes().maxCoeff(), most = options_.most_repeats + 1.0;
      if (patch.repeats()) ++baked_;
      if (repeats <= most) continue;
      cv::Mat smaller;
      const double scale = most / repeats;
      cv::resize(patch.texture, smaller,
                 {std::max(1, static_cast<int>(patch.texture.cols * scale)),
                  std::max(1, static_cast<int>(patch.texture.rows * scale))},
                 0, 0, cv::INTER_AREA);
      patch.texture = smaller;
      patch.find_source();
      if (static_cast<double>(patch.source.width) * patch.source.height > kMaxPixels)
        fail<UsageError>(
            "joining the parts of the scan: one triangle repeats its texture {:.0f} times, which no image can hold; "
            "bake "
            "the texture in the modelling program",
            repeats);
      out_.notes.push_back(
          fmt::format("A texture repeats {:.0f} times within a triangle: baked at a lower resolution.", repeats));
    }
    if (baked_ > 0)
      out_.notes.push_back(fmt::format("Texture coordinates beyond 0..1: {} repeated {} baked.", baked_,
                                       baked_ == 1 ? "texture was" : "textures were"));
  }

  /// One texture that neither repeats nor is too large stays untouched.
  bool keep_as_is() {
    const Patch& only = patches_[0];
    if (patches_.size() > 1 || only.repeats() || std::max(only.texture.cols, only.texture.rows) > options_.largest_size)
      return false;
    out_.mesh.texture = only.texture;
    for (const TiledUvs& part : tiled_) {
      const int first = static_cast<int>(out_.mesh.uvs.size());
      out_.mesh.uvs.insert(out_.mesh.uvs.end(), part.uvs.begin(), part.uvs.end());
      for (const Triangle& face : part.face_uvs)
        out_.mesh.face_uvs.push_back({face[0] + first, face[1] + first, face[2] + first});
    }
    return true;
  }

  cv::Size fit() {
    double scale = 1.0;
    cv::Size size = pack(patches_, options_.margin, scale);
    for (int round = 0; round < kPackRounds && std::max(size.width, size.height) > options_.largest_size; ++round) {
      scale *= 0.98 * options_.largest_size / std::max(size.width, size.height);
      size = pack(patches_, options_.margin, scale);
    }
    if (std::max(size.width, size.height) > options_.largest_size)
      fail<UsageError>(
          "joining the parts of the scan: {} textures do not fit into an image of {} pixels; allow a larger one",
          patches_.size(), options_.largest_size);
    if (scale < 1.0)
      out_.notes.push_back(
          fmt::format("The textures were scaled by {:.2f} to fit into {} pixels.", scale, options_.largest_size));
    return size;
  }

  void paint(const Patch& patch, cv::Mat& atlas) const {
    const cv::Rect whole(patch.position.x - options_.margin, patch.position.y - options_.margin,
                         patch.position.width + 2 * options_.margin, patch.position.height + 2 * options_.margin);
    if (patch.position.size() == patch.source.size()) {
      patch.pixels(options_.margin).copyTo(atlas(whole));
      return;
    }
    cv::Mat inner, framed;
    cv::resize(patch.pixels(0), inner, patch.position.size(), 0, 0, cv::INTER_AREA);
    cv::copyMakeBorder(inner, framed, options_.margin, options_.margin, options_.margin, options_.margin,
                       patch.repeats() ? cv::BORDER_WRAP : cv::BORDER_REPLICATE);
    framed.copyTo(atlas(whole));
  }

  static constexpr double kMaxPixels = 4e8;

  const ScanParts& scan_;
  AtlasOptions options_;
  MergedScan out_;
  std::vector<TiledUvs> tiled_;        // [parts]
  std::vector<std::size_t> patch_of_;  // [parts]
  std::vector<Patch> patches_;
  std::map<const void*, std::size_t> textures_;
  int baked_ = 0;
};

}  // namespace

MergedScan merge_parts(const ScanParts& scan, const AtlasOptions& options) { return PartMerger(scan, options).run(); }

}  // namespace doppel
