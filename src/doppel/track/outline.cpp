#include "doppel/track/outline.h"

#include <torch/torch.h>

#include "doppel/render/boundary.h"
#include "doppel/render/projection.h"
#include "doppel/render/render_mesh.h"

namespace doppel {
namespace {

/// Every so many of them that at most `most` stay.
void thin_out(std::vector<OutlineVertex>& vertices, std::size_t first, int most) {
  const std::size_t count = vertices.size() - first, wanted = static_cast<std::size_t>(most);
  if (count <= wanted) return;
  for (std::size_t i = 0; i < wanted; ++i) vertices[first + i] = vertices[first + i * count / wanted];
  vertices.resize(first + wanted);
}

}  // namespace

struct OutlineFinder::State {
  torch::Tensor faces;  ///< int32 [F,3]
  std::vector<Camera> cameras;
  int pixels, most;
};

OutlineFinder::OutlineFinder(const Character& character, std::vector<Camera> cameras, int pixels, int most)
    : state_(new State{RenderMesh(character.mesh).faces, std::move(cameras), pixels, most}) {}
OutlineFinder::~OutlineFinder() = default;
OutlineFinder::OutlineFinder(OutlineFinder&&) noexcept = default;
OutlineFinder& OutlineFinder::operator=(OutlineFinder&&) noexcept = default;

std::vector<OutlineVertex> OutlineFinder::find(const FrameEvidence& frame,
                                               const std::vector<Eigen::Vector3d>& vertices) const {
  const torch::NoGradGuard no_grad;
  std::vector<Camera> windows;
  std::vector<int> seeing;
  for (std::size_t c = 0; c < state_->cameras.size(); ++c) {
    if (frame[c].outline.empty()) continue;
    windows.push_back(crop_camera(state_->cameras[c], frame[c].outline.box(), state_->pixels));
    seeing.push_back(static_cast<int>(c));
  }
  std::vector<OutlineVertex> result;
  if (windows.empty()) return result;
  torch::Tensor surface = torch::empty({1, static_cast<std::int64_t>(vertices.size()), 3});
  float* out = surface.data_ptr<float>();
  for (const Eigen::Vector3d& vertex : vertices)
    for (const double x : vertex) *out++ = static_cast<float>(x);
  const torch::Tensor flags =
      boundary_vertices(surface, projection_tensor(windows).unsqueeze(0), state_->faces, state_->pixels, state_->pixels)
          .contiguous();
  const bool* flag = flags.data_ptr<bool>();
  for (const int camera : seeing) {
    const std::size_t first = result.size();
    for (std::size_t v = 0; v < vertices.size(); ++v)
      if (*flag++) result.push_back({camera, static_cast<int>(v)});
    thin_out(result, first, state_->most);
  }
  return result;
}

std::vector<Eigen::Vector3d> posed_vertices(const PoseModel& model, const PosedBody& body) {
  std::vector<Eigen::Vector3d> vertices;
  for (int v = 0; v < model.character().num_vertices(); ++v) vertices.push_back(model.vertex(body, v));
  return vertices;
}

}  // namespace doppel
