#include "doppel/track/energy/outline.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>

#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/track/energy/drawn_outline.h"

namespace doppel {

struct OutlineFinder::State {
  torch::Tensor faces;  ///< int32 [F,3]
  std::vector<PinholeCamera> cameras;
  int most;

  /// The pixels that the surface covers in the window of a field: 8-bit, other than 0.
  /// @param surface [1,N,3] world metres @param window the camera of the field's window
  cv::Mat drawn(const torch::Tensor& surface, const PinholeCamera& window) const {
    torch::Tensor covered = Rasterizer(faces).coverage_projected(surface, projection_tensor({window}).unsqueeze(0),
                                                                 window.height, window.width);
    return cv::Mat(window.height, window.width, CV_8UC1, covered.contiguous().data_ptr<std::uint8_t>()).clone();
  }
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
  std::vector<OutlineVertex> result;
  for (std::size_t c = 0; c < state_->cameras.size(); ++c) {
    const OutlineField& field = frame[c].outline;
    if (field.empty()) continue;
    const PinholeCamera window = state_->window_of(c, field);
    const double scale = reference_pixels(state_->cameras[c]) * field.box().image_pixels_per_pixel(field.pixels());
    const DrawnOutline outline(state_->drawn(surface, window));
    const std::size_t first = result.size();
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      if (window.camera_from_world(vertices[v]).z() <= 0.0) continue;
      const Eigen::Vector2d pixel = window.project(vertices[v]);
      if (const auto distance = outline.distance(pixel.x(), pixel.y()))
        result.push_back({static_cast<int>(c), static_cast<int>(v), scale * *distance});
    }
    thin_out(result, first, state_->most);
  }
  return result;
}

double OutlineFinder::overlap(const FrameEvidence& frame, const std::vector<Eigen::Vector3d>& vertices) const {
  const torch::NoGradGuard no_grad;
  const torch::Tensor surface = vertex_tensor(vertices);
  double sum = 0.0;
  int seeing = 0;
  for (std::size_t c = 0; c < state_->cameras.size(); ++c) {
    const OutlineField& field = frame[c].outline;
    if (field.empty()) continue;
    const cv::Mat drawn = state_->drawn(surface, state_->window_of(c, field)) > 0, mask = field.inside();
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
