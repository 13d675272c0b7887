#include "doppel/track/energy/outline.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <opencv2/core.hpp>

#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/outline/boundary.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"

namespace doppel {

namespace {}  // namespace

struct OutlineFinder::State {
  torch::Tensor faces;  ///< int32 [F,3]
  std::vector<PinholeCamera> cameras;
  int pixels, most;
};

OutlineFinder::OutlineFinder(const Character& character, std::vector<PinholeCamera> cameras, int pixels, int most)
    : state_(new State{RenderMesh(character.mesh).faces, std::move(cameras), pixels, most}) {}
OutlineFinder::~OutlineFinder() = default;

struct OutlineFinder::Windows {
  std::vector<PinholeCamera> cameras;
  std::vector<int> seeing;  ///< indices of these cameras

  Windows(const State& state, const FrameEvidence& frame) {
    for (std::size_t c = 0; c < state.cameras.size(); ++c) {
      if (frame[c].outline.empty()) continue;
      cameras.push_back(crop_camera(state.cameras[c], frame[c].outline.box(), state.pixels));
      seeing.push_back(static_cast<int>(c));
    }
  }
  torch::Tensor projection() const { return projection_tensor(cameras).unsqueeze(0); }
};

std::vector<OutlineVertex> OutlineFinder::find(const FrameEvidence& frame,
                                               const std::vector<Eigen::Vector3d>& vertices) const {
  const torch::NoGradGuard no_grad;
  const Windows windows(*state_, frame);
  std::vector<OutlineVertex> result;
  if (windows.cameras.empty()) return result;
  const torch::Tensor flags =
      boundary_vertices(vertex_tensor(vertices), windows.projection(), state_->faces, state_->pixels, state_->pixels)
          .contiguous();
  const bool* flag = flags.data_ptr<bool>();
  for (const int camera : windows.seeing) {
    const std::size_t first = result.size();
    for (std::size_t v = 0; v < vertices.size(); ++v)
      if (*flag++) result.push_back({camera, static_cast<int>(v), 0.0});
    thin_out(result, first, state_->most);
  }
  return result;
}

double OutlineFinder::overlap(const FrameEvidence& frame, const std::vector<Eigen::Vector3d>& vertices) const {
  const torch::NoGradGuard no_grad;
  const Windows windows(*state_, frame);
  if (windows.cameras.empty()) return 0.0;
  const torch::Tensor drawn =
      Rasterizer(state_->faces)
          .coverage_projected(vertex_tensor(vertices), windows.projection(), state_->pixels, state_->pixels)
          .contiguous();
  const cv::Mat all(static_cast<int>(windows.cameras.size()) * state_->pixels, state_->pixels, CV_8UC1,
                    drawn.data_ptr<std::uint8_t>());
  double sum = 0.0;
  for (std::size_t i = 0; i < windows.seeing.size(); ++i) {
    const cv::Mat surface =
        all.rowRange(static_cast<int>(i) * state_->pixels, static_cast<int>(i + 1) * state_->pixels) > 0;
    const cv::Mat mask = frame[windows.seeing[i]].outline.inside();
    sum += static_cast<double>(cv::countNonZero(surface & mask)) / std::max(1, cv::countNonZero(surface | mask));
  }
  return sum / static_cast<double>(windows.cameras.size());
}

std::vector<Eigen::Vector3d> posed_vertices(const PoseModel& model, const PosedBody& body) {
  std::vector<Eigen::Vector3d> vertices;
  for (int v = 0; v < model.character().num_vertices(); ++v) vertices.push_back(model.vertex(body, v));
  return vertices;
}

}  // namespace doppel
