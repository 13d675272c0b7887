#include "doppel/data/capture/vertex_labels.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <array>
#include <queue>
#include <tuple>

#include "doppel/character/labels.h"
#include "doppel/core/as_size.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/geometry/image_file.h"
#include "doppel/geometry/topology.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr int kBackground = 0;
constexpr float kDepthTolerance = 0.02f;  // metres, so that an inclined surface does not occlude itself

std::uint32_t colour(int red, int green, int blue) { return static_cast<std::uint32_t>(red << 16 | green << 8 | blue); }

std::uint32_t read_colour(const ConfigReader& root, const std::string& key) {
  const std::vector<int> value = root.list<int>(key);
  if ((value.size() != 1 && value.size() != 3) ||
      std::any_of(value.begin(), value.end(), [](int x) { return x < 0 || x > 255; }))
    root.fail_at_key(key, "must be a grey value or [red, green, blue], each 0 to 255");
  return value.size() == 1 ? colour(value[0], value[0], value[0]) : colour(value[0], value[1], value[2]);
}

/// The votes of all views for one vertex.
struct Votes {
  std::array<int, kNumLabels> count{};
  std::array<double, kNumLabels> directness{};  ///< sum of the cosines to the normal

  /// @return -1 without votes
  int winner() const {
    int best = -1;
    for (int label = 0; label < kNumLabels; ++label) {
      const auto l = as_size(label), b = as_size(std::max(best, 0));
      if (count[l] == 0) continue;
      if (best < 0 || count[l] > count[b] || (count[l] == count[b] && directness[l] > directness[b])) best = label;
    }
    return best;
  }
};

/// Adds the votes of a view for the vertices that it sees: vertices that face the camera and are not occluded.
void vote(const LabelView& view, const TriangleMesh& posed, const std::vector<Eigen::Vector3d>& normals,
          Rasterizer& rasterizer, std::vector<Votes>& votes) {
  const Camera& camera = view.camera;
  const PinholeCamera pinhole = without_distortion(camera);
  const RasterImage& image = rasterizer.rasterize_projected(
      vertex_tensor(posed.vertices), projection_tensor({pinhole}).unsqueeze(0), camera.height, camera.width);
  const float* depth = image.depth.data_ptr<float>();
  const auto inside = [&](const Eigen::Vector2d& pixel) {
    return pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() < camera.width && pixel.y() < camera.height;
  };
  for (std::size_t i = 0; i < votes.size(); ++i) {
    const Eigen::Vector3d& vertex = posed.vertices[i];
    const double z = camera.camera_from_world(vertex).z();
    const double cosine = normals[i].dot((camera.centre() - vertex).normalized());
    if (!(z > 0.0) || !(cosine > 0.0)) continue;
    const Eigen::Vector2d drawn = pinhole.project(vertex), seen = camera.project(vertex);
    if (!inside(drawn) || !inside(seen)) continue;
    const auto pixel = as_size(drawn.y()) * as_size(camera.width) + as_size(drawn.x());
    if (!(depth[pixel] >= static_cast<float>(z) - kDepthTolerance)) continue;
    const int label = view.labels.at<std::uint8_t>(static_cast<int>(seen.y()), static_cast<int>(seen.x()));
    if (label == kBackground) continue;
    ++votes[i].count[label];
    votes[i].directness[label] += cosine;
  }
}

/// For every vertex the nearest of `sources` along edges, or -1 if no path leads to any of them.
std::vector<int> nearest_along(const TriangleMesh& mesh, const std::vector<int>& sources) {
  using Entry = std::tuple<double, int, int>;  // length, source, vertex
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (const int source : sources) queue.emplace(0.0, source, source);
  const MeshTopology topology(mesh);
  std::vector<int> nearest(mesh.vertices.size(), -1);
  while (!queue.empty()) {
    const auto [length, source, vertex] = queue.top();
    queue.pop();
    const auto v = as_size(vertex);
    if (nearest[v] >= 0) continue;
    nearest[v] = source;
    for (const int neighbour : topology.one_ring().row(vertex)) {
      const auto next = as_size(neighbour);
      if (nearest[next] < 0) queue.emplace(length + (mesh.vertices[next] - mesh.vertices[v]).norm(), source, neighbour);
    }
  }
  return nearest;
}

/// Gives vertices without a label (-1) the label of the nearest labelled vertex along the mesh; on components without
/// any label, that of the nearest in space.
void fill_in(const TriangleMesh& mesh, std::vector<int>& labels) {
  std::vector<int> known;
  for (std::size_t i = 0; i < labels.size(); ++i)
    if (labels[i] >= 0) known.push_back(static_cast<int>(i));
  const std::vector<int> nearest = nearest_along(mesh, known);
  const auto position = [&](int vertex) -> const Eigen::Vector3d& { return mesh.vertices[vertex]; };
  std::vector<int> filled = labels;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    int source = nearest[i];
    if (source < 0)
      source = *std::min_element(known.begin(), known.end(), [&](int a, int b) {
        return (position(a) - mesh.vertices[i]).squaredNorm() < (position(b) - mesh.vertices[i]).squaredNorm();
      });
    filled[i] = labels[source];
  }
  labels = std::move(filled);
}

}  // namespace

LabelLegend::LabelLegend() {
  for (int label = 0; label < kNumLabels; ++label) label_of_[colour(label, label, label)] = label;
}

LabelLegend LabelLegend::read(const fs::path& path) {
  const ConfigDocument document = ConfigDocument::load(path);
  const ConfigReader root = document.root();
  LabelLegend legend;
  legend.label_of_.clear();
  const auto& names = label_names();
  for (std::size_t label = 0; label < names.size(); ++label) {
    if (!root.has(names[label])) continue;
    const auto [slot, fresh] = legend.label_of_.emplace(read_colour(root, names[label]), static_cast<int>(label));
    if (!fresh)
      root.fail_at_key(names[label], "has the same colour as '{}'; every label needs its own", names[slot->second]);
  }
  root.finish();
  if (legend.label_of_.empty())
    fail_at({path.string(), 0}, "the legend names no label; it maps some of {} to colours", fmt::join(names, ", "));
  return legend;
}

cv::Mat LabelLegend::labels(const cv::Mat& image, const std::string& source) const {
  const int channels = image.channels();
  if (image.depth() != CV_8U || (channels != 1 && channels != 3 && channels != 4))
    fail_at({source, 0}, "label images have 8 bits and 1, 3 or 4 channels; this one has {} and {}",
            8 * image.elemSize1(), channels);
  cv::Mat result(image.size(), CV_8UC1);
  for (int row = 0; row < image.rows; ++row) {
    const std::uint8_t* in = image.ptr<std::uint8_t>(row);
    for (int column = 0; column < image.cols; ++column, in += channels) {
      const auto found = label_of_.find(channels == 1 ? colour(in[0], in[0], in[0]) : colour(in[2], in[1], in[0]));
      if (found == label_of_.end())
        fail_at({source, 0},
                "pixel ({}, {}) has the colour (red {}, green {}, blue {}), which has no label; name it in the "
                "legend. Colours between labels come from smoothing or lossy compression; use neither",
                column, row, channels == 1 ? in[0] : in[2], channels == 1 ? in[0] : in[1], in[0]);
      result.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(found->second);
    }
  }
  return result;
}

std::vector<LabelView> read_label_views(const fs::path& folder, const std::vector<Camera>& cameras,
                                        const LabelLegend& legend) {
  if (!fs::is_directory(folder)) fail("label images: {} is no folder", folder.string());
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().filename().string().front() != '.') files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<std::string> names;
  for (const Camera& camera : cameras) names.push_back(camera.name);
  if (files.empty())
    fail("label images: {} contains none; they have the names of the cameras ({}) and the extension of an image",
         folder.string(), fmt::join(names, ", "));
  std::vector<LabelView> views;
  for (const fs::path& file : files) {
    const auto name = std::find(names.begin(), names.end(), file.stem().string());
    if (name == names.end())
      fail("label images: {} belongs to no camera; the calibration has {}", file.string(), fmt::join(names, ", "));
    const cv::Mat image = read_image(file);
    const Camera& camera = cameras[name - names.begin()];
    views.push_back({fit_to_images(camera, image.size(), file.string()), legend.labels(image, file.string())});
  }
  return views;
}

VertexLabels label_vertices(const Character& character, const std::vector<Eigen::Vector3d>& vertices,
                            const std::vector<LabelView>& views) {
  const torch::NoGradGuard no_grad;
  if (static_cast<int>(vertices.size()) != character.num_vertices())
    fail("labels of vertices: {} positions are given for {} vertices", vertices.size(), character.num_vertices());
  TriangleMesh posed = character.mesh;
  posed.vertices = vertices;
  const std::vector<Eigen::Vector3d> normals = vertex_normals(posed);
  Rasterizer rasterizer(RenderMesh(character.mesh).faces);
  std::vector<Votes> votes(vertices.size());
  for (const LabelView& view : views) vote(view, posed, normals, rasterizer, votes);
  VertexLabels result;
  for (const Votes& vertex : votes) {
    result.labels.push_back(vertex.winner());
    result.voted += result.labels.back() >= 0;
  }
  if (result.voted == 0)
    fail(
        "labels of vertices: no vertex is visible on a label in any of {} images; the calibration, the pose or the "
        "names of the images do not belong to this character",
        views.size());
  fill_in(character.mesh, result.labels);
  return result;
}

}  // namespace doppel
