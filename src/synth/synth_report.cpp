#include "doppel/synth/synth_report.h"

#include <torch/types.h>

#include <algorithm>
#include <array>

#include "doppel/core/npy.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/synth/capture_writer.h"

namespace doppel::synth {

namespace {

using Eigen::Vector3d;

constexpr int kMaxMeasured = 100;  ///< frames

torch::Tensor in_cameras(const Points& vertices, const std::vector<Camera>& cameras) {
  torch::Tensor points =
      torch::empty({static_cast<int64_t>(cameras.size()), static_cast<int64_t>(vertices.size()), 3}, torch::kFloat32);
  float* out = points.data_ptr<float>();
  for (const Camera& camera : cameras)
    for (const Vector3d& v : vertices)
      for (const double x : Vector3d(camera.camera_from_world(v))) *out++ = static_cast<float>(x);
  return points;
}

/// Mean intersection over union of two surfaces' silhouettes in all cameras.
double silhouette_iou(Rasterizer& rasterizer, const std::vector<Camera>& cameras, const Points& a, const Points& b) {
  torch::Tensor intrinsics = torch::empty({static_cast<int64_t>(cameras.size()), 4}, torch::kFloat32);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Eigen::Matrix3d& K = cameras[c].K;
    const std::array<double, 4> row{K(0, 0), K(1, 1), K(0, 2), K(1, 2)};
    for (int k = 0; k < 4; ++k) intrinsics[static_cast<int64_t>(c)][k] = row[k];
  }
  const int64_t height = cameras.front().height, width = cameras.front().width;
  const torch::Tensor x = rasterizer.coverage(in_cameras(a, cameras), intrinsics, height, width).to(torch::kBool);
  const torch::Tensor y = rasterizer.coverage(in_cameras(b, cameras), intrinsics, height, width).to(torch::kBool);
  const torch::Tensor both = x.logical_and(y).sum({1, 2}).to(torch::kFloat64);
  const torch::Tensor any = x.logical_or(y).sum({1, 2}).to(torch::kFloat64);
  return (both / any).mean().item<double>();
}

}  // namespace

SynthReport measure_capture(const CaptureSet& set, const std::string& sequence) {
  const Character& c = set.actor.character;
  SynthReport report;
  report.vertices = c.num_vertices();
  report.faces = c.mesh.num_faces();
  report.nodes = c.num_nodes();
  report.dofs = c.num_dofs();
  Rasterizer rasterizer(face_tensor(c.mesh));
  NpyItems surfaces(surfaces_file(set.root, sequence));
  const Motion motion = read_motion(motion_rows_file(set.root / sequence), c.num_dofs());
  const int stride = (motion.num_frames() + kMaxMeasured - 1) / kMaxMeasured;
  Motion measured;
  for (int f = 0; f < motion.num_frames(); f += stride) {
    measured.frames.push_back(motion.frames[f]);
    measured.ids.push_back(f);
  }
  const std::vector<Points> all_skinned = skin_motion(c, measured, {});
  int vertices = 0;
  for (int f = 0; f < measured.num_frames(); ++f) {
    const Points& skinned = all_skinned[f];
    const Points ground_truth = as_points(surfaces.read(measured.ids[f]));
    for (int v = 0; v < c.num_vertices(); ++v) {
      const double moved = (ground_truth[v] - skinned[v]).norm();
      report.largest_displacement = std::max(report.largest_displacement, moved);
      if (set.actor.looseness[v] < 0.05) continue;
      report.mean_displacement += moved;
      ++vertices;
    }
    report.skinning_iou += silhouette_iou(rasterizer, set.cameras, skinned, ground_truth);
  }
  report.mean_displacement /= std::max(vertices, 1);
  report.skinning_iou /= std::max(measured.num_frames(), 1);
  return report;
}

}  // namespace doppel::synth
