/// Each operator called from Python (libdoppel.so, package python/doppel) against the function called from C++, on
/// the same inputs. Both take turns within one run; the ratio is C++ time : Python time, so 1 says that a call from
/// Python costs nothing.
///   operator_bench [threads=2]

#include <ATen/Parallel.h>
#include <sys/wait.h>
#include <torch/torch.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "doppel/core/process.h"
#include "doppel/geometry/topology.h"
#include "doppel/layers/closest_point/closest_point.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"
#include "doppel/layers/skinning/skinning.h"
#include "doppel/losses/silhouette.h"
#include "doppel/render/outline/boundary.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/render/shading/shading.h"
#include "geometry/meshes.h"
#include "layers/body.h"
#include "support/ratio.h"

namespace doppel::bench {
namespace {

using torch::Tensor;

/// operator_bench.py with its operators: a line with a name goes in, milliseconds per call come out.
class PythonSide {
 public:
  explicit PythonSide(const std::string& inputs, int threads) {
    int to[2], from[2];
    if (pipe(to) != 0 || pipe(from) != 0) std::exit(1);
    child_ = fork();
    if (child_ == 0) {
      dup2(to[0], 0);
      dup2(from[1], 1);
      for (const int end : {to[0], to[1], from[0], from[1]}) close(end);
      // As setup_process does.
      setenv("MALLOC_MMAP_MAX_", "0", 1);
      setenv("MALLOC_TOP_PAD_", "16777216", 1);
      setenv("MALLOC_TRIM_THRESHOLD_", "-1", 1);
      setenv("DOPPEL_LIBRARY", DOPPEL_LIBRARY, 1);
      setenv("PYTHONPATH", PYTHON_PACKAGE, 1);
      execl("/usr/bin/python3", "python3", OPERATOR_SCRIPT, inputs.c_str(), std::to_string(threads).c_str(), nullptr);
      _exit(127);
    }
    close(to[0]);
    close(from[1]);
    ask_ = fdopen(to[1], "w");
    answers_ = fdopen(from[0], "r");
  }
  ~PythonSide() {
    std::fclose(ask_);
    std::fclose(answers_);
    waitpid(child_, nullptr, 0);
  }
  PythonSide(const PythonSide&) = delete;
  PythonSide& operator=(const PythonSide&) = delete;

  double milliseconds(const std::string& name) {
    std::fprintf(ask_, "%s\n", name.c_str());
    std::fflush(ask_);
    double result = 0.0;
    if (std::fscanf(answers_, "%lf", &result) != 1) {
      std::fprintf(stderr, "operator_bench.py gave no answer for %s; is python3-torch installed?\n", name.c_str());
      std::exit(1);
    }
    return result;
  }

 private:
  pid_t child_ = 0;
  std::FILE *ask_ = nullptr, *answers_ = nullptr;
};

/// Cameras on a circle around the origin, 512 x 512 pixels. @return [1,count,3,4]
Tensor ring_of_cameras(int count) {
  const Tensor k = torch::tensor({{600.0f, 0.0f, 256.0f}, {0.0f, 600.0f, 256.0f}, {0.0f, 0.0f, 1.0f}});
  std::vector<Tensor> projections;
  for (int c = 0; c < count; ++c) {
    const float a = 6.2831853f * static_cast<float>(c) / static_cast<float>(count), s = std::sin(a), o = std::cos(a);
    projections.push_back(k.mm(torch::tensor({{o, 0.0f, -s, 0.0f}, {0.0f, -1.0f, 0.0f, 0.0f}, {-s, 0.0f, -o, 3.0f}})));
  }
  return torch::stack(projections).unsqueeze(0);
}

/// A disc as the mask of each view.
SilhouetteTarget disc(const Tensor& projection) {
  const auto views = projection.size(1);
  const Tensor at = torch::arange(512).to(torch::kFloat32) + 0.5 - 256.0, turn = torch::linspace(0.0, 6.28, 1200);
  SilhouetteTarget target;
  target.projection = projection;
  target.distance =
      ((at.unsqueeze(0).square() + at.unsqueeze(1).square()).sqrt() - 190.0).expand({1, views, 512, 512}).contiguous();
  target.valid = torch::ones({1, views}, torch::kBool);
  target.contour = (torch::stack({turn.cos(), turn.sin()}, 1) * 190.0 + 256.0).repeat({views, 1});
  target.contour_offsets = torch::arange(views + 1) * 1200;
  return target;
}

Tensor indices(const std::vector<int>& values) { return torch::tensor(values, torch::kInt32); }

int run(int threads) {
  setup_process();
  at::set_num_threads(threads);
  torch::manual_seed(1);
  const torch::NoGradGuard no_grad;
  const Body body = make_body();
  const auto n = static_cast<std::int64_t>(body.vertices.size());
  const TriangleMesh sphere = support::make_sphere(5);
  const Tensor points = points_tensor(body.vertices), nodes = points_tensor(body.nodes);
  std::vector<int> corners;
  for (const Triangle& face : sphere.faces) corners.insert(corners.end(), face.begin(), face.end());
  const Tensor faces = indices(corners).view({-1, 3}), vertices = points_tensor(sphere.vertices).unsqueeze(0);

  const SparseRows skin_rows(body.skin.vertex_bones, body.skin.weights, 70, "skinning weights");
  const DeformationGraph graph(body.vertices, body.nodes, body.vertex_nodes, body.node_weights);
  const Tensor edges = torch::stack({torch::arange(n - 1), torch::arange(1, n)}, 1).to(torch::kInt32);
  std::vector<std::array<int, 2>> links;
  for (int v = 0; v + 1 < n; ++v) links.push_back({v, v + 1});
  const RingWeights ring = RingWeights::from_topology({static_cast<int>(n), links}, 3);
  const ClosestPoint closest(sphere);
  const RenderMesh mesh(faces, torch::Tensor(), vertices.size(1));

  const Tensor bones = torch::eye(3, 4).repeat({16, 70, 1, 1}).contiguous();
  const Tensor angles = 0.1 * torch::randn({16, 500, 3}), moves = 0.1 * torch::randn({16, 500, 3});
  const Tensor features = torch::randn({8, n, 16}), kernels = torch::randn({n, 16, 16}), bias = torch::randn({n, 16});
  const Tensor samples = 0.97 * torch::nn::functional::normalize(torch::randn({1, 4000, 3}),
                                                                 torch::nn::functional::NormalizeFuncOptions().dim(-1));
  const Tensor in_camera = (vertices + torch::tensor({0.0f, 0.0f, 3.0f})).repeat({8, 1, 1}).contiguous();
  const Tensor intrinsics = torch::tensor({{600.0f, 600.0f, 256.0f, 256.0f}}), cameras = ring_of_cameras(8);
  const SilhouetteTarget target = disc(cameras);
  const Tensor outline = boundary_vertices(vertices, cameras, faces, 512, 512);
  const Tensor light = torch::randn({1, 8, 3, 9});
  ShadingOptions lit;
  lit.lit = true;

  c10::Dict<std::string, Tensor> inputs;
  for (const auto& [name, tensor] :
       std::vector<std::pair<std::string, Tensor>>{{"points", points},
                                                   {"nodes", nodes},
                                                   {"skin_offsets", indices(body.skin.vertex_bones.offsets)},
                                                   {"skin_items", indices(body.skin.vertex_bones.items)},
                                                   {"skin_weights", torch::tensor(body.skin.weights, torch::kFloat64)},
                                                   {"node_offsets", indices(body.vertex_nodes.offsets)},
                                                   {"node_items", indices(body.vertex_nodes.items)},
                                                   {"node_weights", torch::tensor(body.node_weights, torch::kFloat64)},
                                                   {"edges", edges},
                                                   {"faces", faces},
                                                   {"vertices", vertices},
                                                   {"bones", bones},
                                                   {"angles", angles},
                                                   {"moves", moves},
                                                   {"features", features},
                                                   {"kernels", kernels},
                                                   {"bias", bias},
                                                   {"samples", samples},
                                                   {"in_camera", in_camera},
                                                   {"intrinsics", intrinsics},
                                                   {"cameras", cameras},
                                                   {"distance", target.distance},
                                                   {"valid", target.valid},
                                                   {"contour", target.contour},
                                                   {"contour_offsets", target.contour_offsets},
                                                   {"outline", outline},
                                                   {"light", light}})
    inputs.insert(name, tensor);
  const auto path = std::filesystem::temp_directory_path() / ("operator_bench_" + std::to_string(getpid()) + ".pt");
  const std::vector<char> bytes = torch::pickle_save(inputs);
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));

  const std::vector<Candidate> operators = {
      {"Skinning", [&] { skinning(points, bones, skin_rows, SkinningMode::dual_quaternion); }},
      {"EmbeddedDeformation", [&] { embedded_deformation(angles, moves, {}, {}, graph); }},
      {"GraphConvolution", [&] { graph_convolution(features, kernels, bias, ring); }},
      {"ClosestPoint", [&] { closest->forward(vertices, samples); }},
      {"Shading", [&] { shade(vertices, {}, light, cameras, mesh, 512, 512, lit); }},
      {"rasterize", [&] { rasterize(in_camera, intrinsics, faces, 512, 512); }},
      {"boundary_vertices", [&] { boundary_vertices(vertices, cameras, faces, 512, 512); }},
      {"silhouette_loss", [&] { silhouette_loss(vertices, faces, outline, target); }},
  };
  PythonSide python(path.string(), threads);
  std::printf("%-22s %10s %12s %9s\n", "operator", "C++ ms", "Python ms", "C++:Python");
  double worst = INFINITY;
  for (const Candidate& ours : operators) {
    std::vector<double> here, there, ratios;
    for (int turn = -2; turn < 15; ++turn) {
      const double cpp = time_turn(ours.run, 20.0), py = python.milliseconds(ours.name);
      if (turn < 0) continue;
      here.push_back(cpp);
      there.push_back(py);
      ratios.push_back(cpp / py);
    }
    std::printf("%-22s %10.3f %12.3f %9.2f\n", ours.name.c_str(), median(here), median(there), median(ratios));
    worst = std::min(worst, median(ratios));
  }
  std::printf("lowest ratio %.2f\n", worst);
  std::filesystem::remove(path);
  return 0;
}

}  // namespace
}  // namespace doppel::bench

int main(int argc, char** argv) { return doppel::bench::run(argc > 1 ? std::atoi(argv[1]) : 2); }
