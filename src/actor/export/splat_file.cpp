#include "doppel/actor/export/splat_file.h"

#include <fmt/format.h>

#include <bit>

#include "doppel/actor/export/splat_primitive.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

using torch::Tensor;

static_assert(std::endian::native == std::endian::little, "both formats take the bytes of floats as they are");

constexpr std::int64_t kMaxGlbBytes = 4'000'000'000;  // a .glb file counts its bytes in 32 bits

std::string ply_header(std::int64_t count, std::int64_t harmonics) {
  std::string header = fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", count);
  const auto add = [&](const std::string& name) { header += "property float " + name + "\n"; };
  const auto add_numbered = [&](const char* name, std::int64_t number) {
    for (std::int64_t i = 0; i < number; ++i) add(fmt::format("{}_{}", name, i));
  };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) add(name);
  add_numbered("f_dc", 3);
  add_numbered("f_rest", 3 * (harmonics - 1));
  add("opacity");
  add_numbered("scale", 3);
  add_numbered("rot", 4);
  return header + "end_header\n";
}

tinygltf::Model splat_model(const WrittenSplats& splats) {
  tinygltf::Model model = empty_glb_model();
  GlbBuffer buffer(model);
  model.extensionsUsed.emplace_back(kSplatExtension);
  tinygltf::Mesh mesh;
  mesh.primitives.push_back(splat_primitive(buffer, splats));
  model.meshes.push_back(mesh);
  tinygltf::Node node;
  node.name = "splats";
  node.mesh = 0;
  model.nodes.push_back(node);
  tinygltf::Scene scene;
  scene.nodes = {0};
  model.scenes.push_back(scene);
  model.defaultScene = 0;
  return model;
}

}  // namespace

void write_splat_ply(const std::filesystem::path& file, const Splats& splats, std::int64_t item) {
  const torch::NoGradGuard no_gradient;
  const std::string action = "writing " + file.string();
  check_written(action, splats, item);
  const WrittenSplats written = written_splats(action, splats, item);
  const Tensor first = written.harmonics.select(1, 0), rest = written.harmonics.slice(1, 1).transpose(1, 2);
  const std::int64_t count = first.size(0), harmonics = written.harmonics.size(1);
  const Tensor rows = torch::cat({written.positions, written.normals, first, rest.reshape({count, 3 * (harmonics - 1)}),
                                  written.opacities, written.log_scales, written.rotations},
                                 1);
  std::string content = ply_header(count, harmonics);
  content.append(static_cast<const char*>(rows.data_ptr()), rows.nbytes());
  write_atomically(file, content);
}

void write_splat_glb(const std::filesystem::path& file, const Splats& splats, std::int64_t item) {
  const torch::NoGradGuard no_gradient;
  const std::string action = "writing " + file.string();
  check_written(action, splats, item);
  const std::int64_t count = splats.positions.size(1), width = 15 + 3 * splats.harmonics.size(2);
  if (count > kMaxGlbBytes / (4 * width))
    fail("{}: {} Gaussians of {} bytes need {:.1f} GB, and a .glb file holds 4 GB; write fewer, or a .ply file", action,
         count, 4 * width, static_cast<double>(4 * width) * static_cast<double>(count) / 1e9);
  write_glb_model(file, splat_model(written_splats(action, splats, item)));
}

}  // namespace doppel
