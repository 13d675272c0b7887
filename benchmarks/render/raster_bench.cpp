// The rasterizer against Embree and OSMesa on the same triangles, in turns within one run.
//   raster_bench [threads=2] [pixels=512]
// Face ids are compared first; the times count only if the images are equal.

#include <ATen/Parallel.h>
#include <torch/types.h>

#include <cstdio>
#include <cstdlib>

#include "doppel/core/cpu_dispatch.h"
#include "doppel/core/process.h"
#include "doppel/render/outline/boundary.h"
#include "doppel/render/raster/rasterizer.h"
#include "render/bench_mesh.h"
#include "support/ratio.h"
#if defined(DOPPEL_HAVE_EMBREE)
#include "render/embree_peer.h"
#endif
#if defined(DOPPEL_HAVE_OSMESA)
#include "render/osmesa_peer.h"
#endif

namespace {

using namespace doppel;
using namespace doppel::bench;
using torch::Tensor;

constexpr double kEqualShare = 0.9998;  // of the pixels that must show the same face
constexpr double kCoverageBound =
    0.2;  // ms and core: set-up and exact coverage of such a mesh by a good vector rasterizer
constexpr double kLimitOneThread = 0.41;  // ms at 512^2: the same plus depth, barycentrics and writing them

[[maybe_unused]] bool same_faces(const char* peer, const Tensor& ours, const std::vector<int>& theirs) {
  const Tensor other =
      torch::from_blob(const_cast<int*>(theirs.data()), {static_cast<std::int64_t>(theirs.size())}, torch::kInt32);
  const double share = (ours.flatten() == other).to(torch::kFloat64).mean().item<double>();
  std::printf("%-8s shows the same face in %.4f %% of the pixels (%s)\n", peer, 100 * share,
              share >= kEqualShare ? "equal" : "DIFFERENT");
  return share >= kEqualShare;
}

void compare_batch(const BenchMesh& mesh, int size, const Tensor& intrinsics) {
  const Tensor views = bench_views(mesh, 8);
  Rasterizer rasterizer(mesh.faces);
  const auto timing = compare("8 views, id + depth + barycentrics",
                              {{"doppel", [&] { rasterizer.rasterize(views, intrinsics, size, size); }}});
  std::printf("  per view %.3f ms\n", timing.back().median_ms / 8);
}

void compare_boundary(const BenchMesh& mesh) {
  constexpr int kSize = 350, kBatch = 8, kCameras = 8;
  const Tensor vertices = mesh.vertices.unsqueeze(0).expand({kBatch, -1, 3}).contiguous();
  std::vector<Tensor> cameras;
  for (int k = 0; k < kCameras; ++k) {
    const double angle = k * M_PI / 4, s = std::sin(angle), c = std::cos(angle), f = 1.8 * kSize, h = kSize / 2.0;
    cameras.push_back(
        torch::tensor({-c * f - s * h, 0.0, -s * f + c * h, 4 * h, -s * h, -f, c * h, 4 * h, -s, 0.0, c, 4.0})
            .reshape({3, 4}));
  }
  const Tensor projection = torch::stack(cameras).to(torch::kFloat32).expand({kBatch, kCameras, 3, 4}).contiguous();
  compare("boundary vertices, 8 x 8 views of 350^2",
          {{"doppel", [&] { boundary_vertices(vertices, projection, mesh.faces, kSize, kSize); }}});
}

}  // namespace

int main(int argc, char** argv) {
  start_tuned(argv);
  const int threads = argc > 1 ? std::atoi(argv[1]) : 2, size = argc > 2 ? std::atoi(argv[2]) : 512;
  at::set_num_threads(threads);
  const BenchMesh mesh = bench_mesh();
  const Tensor view = bench_views(mesh, 1);
  const auto f = static_cast<float>(1.8 * size), c = static_cast<float>(size) / 2;
  const Tensor intrinsics = torch::tensor({f, f, c, c}).unsqueeze(0);
  Rasterizer rasterizer(mesh.faces);
  const Tensor ours = rasterizer.rasterize(view, intrinsics, size, size).face_id.clone();
  std::printf("%s: %ld faces, %d x %d pixels, %ld covered, %d threads, %s\n", mesh.name.c_str(),
              static_cast<long>(mesh.faces.size(0)), size, size,
              static_cast<long>((ours >= 0).sum().item<std::int64_t>()), threads, isa_name(cpu_isa()));

  [[maybe_unused]] const PeerScene scene{view.data_ptr<float>(),
                                         static_cast<long>(view.size(1)),
                                         mesh.faces.data_ptr<int>(),
                                         static_cast<long>(mesh.faces.size(0)),
                                         size,
                                         f,
                                         c,
                                         threads};
  std::vector<Candidate> candidates;
  bool equal = true;
#if defined(DOPPEL_HAVE_EMBREE)
  EmbreePeer embree(scene);
  embree.draw();
  equal = same_faces("Embree", ours, embree.face_id()) && equal;
  candidates.push_back({"Embree 3, refit + 16-ray packets", [&] { embree.draw(); }});
#endif
#if defined(DOPPEL_HAVE_OSMESA)
  OsmesaPeer osmesa(scene);
  osmesa.draw();
  equal = same_faces("OSMesa", ours, osmesa.face_id()) && equal;
  candidates.push_back({"OSMesa llvmpipe, id + depth read", [&] { osmesa.draw(); }});
#endif
  candidates.push_back({"doppel, coverage only", [&] { rasterizer.coverage(view, intrinsics, size, size); }});
  candidates.push_back(
      {"doppel, id + depth + barycentrics", [&] { rasterizer.rasterize(view, intrinsics, size, size); }});
  const auto timings = compare("one view", candidates, {5, 101, 2.0});
  const double whole = timings.back().best_ms * threads, coverage = timings[timings.size() - 2].best_ms * threads;
  std::printf("  core time at best: coverage %.3f ms = %.1f x the bound of %.2f ms", coverage,
              coverage / kCoverageBound, kCoverageBound);
  if (size == 512)
    std::printf("; all outputs %.3f ms = %.1f x the limit of %.2f ms", whole, whole / kLimitOneThread, kLimitOneThread);
  std::printf("\n");
  compare_batch(mesh, size, intrinsics);
  compare_boundary(mesh);
  return equal ? 0 : 1;
}
