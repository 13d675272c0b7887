#include "doppel/track/energy/outline.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <utility>

#include "doppel/core/thin_out.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/track/energy/drawn_outline.h"

namespace doppel {

namespace {

/// The pixels that a surface covers in the window of a field: 8-bit, other than 0.
/// @param surface [1,N,3] world metres @param window the camera of the field's window
cv::Mat drawn_in(Rasterizer& rasterizer, const torch::Tensor& surface, const PinholeCamera& window) {
  torch::Tensor covered =
      rasterizer.coverage_projected(surface, projection_tensor({window}).unsqueeze(0), window.height, window.width);
  return cv::Mat(window.height, window.width, CV_8UC1, covered.data_ptr<std::uint8_t>()).clone();
}

}  // namespace

struct OutlineFinder::State {
  torch::Tensor faces;  ///< int32 [F,3]
  std::vector<PinholeCamera> cameras;
  int most;

  PinholeCamera window_of(std::size_t camera, const OutlineField& field) const {
    return crop_camera(cameras[camera], field.box(), field.pixels());
  }
};

OutlineFinder::OutlineFinder(const Character& character, std::vector<PinholeCamera> cameras, int most)
    : state_(new State{RenderMesh(character.mesh).faces, std::move(cameras), most}) {}
OutlineFinder::~OutlineFinder() = default;

std::vector<OutlineVertex> OutlineFinder::find(const FrameEvidence& frame,
                                               const std::vector<Eigen::Vector3d>& vertices) const {
  const torch::NoGradGuard no_grad;
  const torch::Tensor surface = vertex_tensor(vertices);
  Rasterizer rasterizer(state_->faces);
  std::vector<OutlineVertex> result;
  for (std::size_t c = 0; c < state_->cameras.size(); ++c) {
    const OutlineField& field = frame[c].outline;
    if (field.empty()) continue;
    const PinholeCamera window = state_->window_of(c, field);
    const double scale = reference_pixels(state_->cameras[c]) * field.box().image_pixels_per_pixel(field.pixels());
    const DrawnOutline outline(drawn_in(rasterizer, surface, window));
    std::vector<std::pair<int, Eigen::Vector2d>> found;  // vertices and where the window shows them
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      const Eigen::Vector3d seen = window.K * window.camera_from_world(vertices[v]);
      if (seen.z() > 0.0 && outline.holds(seen.x() / seen.z(), seen.y() / seen.z()))
        found.emplace_back(static_cast<int>(v), seen.hnormalized());
    }
    thin_out(found, state_->most);
    for (const auto& [vertex, pixel] : found)
      result.push_back({static_cast<int>(c), vertex, scale * outline.distance(pixel.x(), pixel.y())});
  }
  return result;
}

double OutlineFinder::overlap(const FrameEvidence& frame, const std::vector<Eigen::Vector3d>& vertices) const {
  const torch::NoGradGuard no_grad;
  const torch::Tensor surface = vertex_tensor(vertices);
  Rasterizer rasterizer(state_->faces);
  double sum = 0.0;
  int seeing = 0;
  for (std::size_t c = 0; c < state_->cameras.size(); ++c) {
    const OutlineField& field = frame[c].outline;
    if (field.empty()) continue;
    const cv::Mat drawn = drawn_in(rasterizer, surface, state_->window_of(c, field)) > 0, mask = field.inside();
    sum += static_cast<double>(cv::countNonZero(drawn & mask)) / std::max(1, cv::countNonZero(drawn | mask));
    ++seeing;
  }
  return seeing > 0 ? sum / seeing : 0.0;
}

std::vector<Eigen::Vector3d> posed_vertices(const PoseModel& model, const PosedBody& body) {
  std::vector<Eigen::Vector3d> vertices;
  for (int v = 0; v < model.character().num_vertices(); ++v) vertices.push_back(model.vertex(body, v));
  return vertices;
}

}  // namespace doppel
