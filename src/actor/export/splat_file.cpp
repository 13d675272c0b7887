#include "doppel/actor/export/splat_file.h"

#include <fmt/format.h>
#include <tiny_gltf.h>
#include <torch/types.h>

#include <bit>
#include <sstream>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {
namespace {

using torch::Tensor;

static_assert(std::endian::native == std::endian::little, "both formats take the bytes of floats as they are");

constexpr std::int64_t kMaxGlbBytes = 4'000'000'000;  // a .glb file counts its bytes in 32 bits
constexpr const char* kSplatExtension = "KHR_gaussian_splatting";

/// The M Gaussians that go into a file.
struct WrittenSplats {
  Tensor positions;   ///< [M,3]
  Tensor normals;     ///< [M,3] zeros when there are none
  Tensor rotations;   ///< [M,4] w x y z, of length 1
  Tensor log_scales;  ///< [M,3]
  Tensor opacities;   ///< [M,1] logits
  Tensor harmonics;   ///< [M,S,3]
};

void check_written(const char* action, const Splats& splats, std::int64_t item) {
  check_floats(action, "positions", splats.positions, {-1, -1, 3}, "[B,N,3]");
  check_splats(action, splats);
  const std::int64_t batch = splats.positions.size(0);
  if (item < 0 || item >= batch)
    fail<UsageError>("{}: batch item {} was asked for, and the Gaussians have {} items, counted from 0", action, item,
                     batch);
}

/// The Gaussians of a batch item that can be written. @param action begins the messages
WrittenSplats written_splats(const std::string& action, const Splats& splats, std::int64_t item) {
  const Tensor positions = splats.positions[item], log_scales = splats.log_scales[item],
               opacities = splats.opacities[item].unsqueeze(1), harmonics = splats.harmonics[item],
               normals = splats.normals.defined() ? splats.normals[item] : torch::zeros_like(positions);
  // In double, so that the square of a small or large quaternion is neither 0 nor infinite.
  const Tensor rotations = splats.rotations[item].to(torch::kFloat64), lengths = rotations.norm(2, 1, true);
  Tensor finite = rotations.isfinite().all(1);
  for (const Tensor& values : {positions, normals, log_scales, log_scales.exp(), opacities, harmonics.flatten(1)})
    finite = finite & values.isfinite().all(1);
  const Tensor index = (finite & (lengths.squeeze(1) > 0)).nonzero().squeeze(1);
  if (index.numel() == 0) {
    const std::int64_t count = positions.size(0), sound = finite.sum().item<std::int64_t>();
    fail(
        "{}: there is no Gaussian to write. Of {} in batch item {}, {} have a value that is not finite and {} have a "
        "quaternion of length 0; check where they come from",
        action, count, item, count - sound, sound);
  }
  const auto kept = [&](const Tensor& values) { return values.index_select(0, index); };
  return {kept(positions),  kept(normals),   kept(rotations / lengths).to(torch::kFloat32),
          kept(log_scales), kept(opacities), kept(harmonics)};
}

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

/// Appends an attribute to the only buffer. @param values float32 [M,W], W = 1, 3 or 4 @return the accessor
int add_attribute(tinygltf::Model& model, const Tensor& values) {
  const Tensor rows = values.contiguous();
  std::vector<unsigned char>& buffer = model.buffers[0].data;
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = buffer.size();
  view.byteLength = rows.nbytes();
  view.target = TINYGLTF_TARGET_ARRAY_BUFFER;
  const auto* first = static_cast<const unsigned char*>(rows.data_ptr());
  buffer.insert(buffer.end(), first, first + rows.nbytes());
  tinygltf::Accessor accessor;
  accessor.bufferView = static_cast<int>(model.bufferViews.size());
  accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
  accessor.type = rows.size(1) == 1   ? TINYGLTF_TYPE_SCALAR
                  : rows.size(1) == 3 ? TINYGLTF_TYPE_VEC3
                                      : TINYGLTF_TYPE_VEC4;
  accessor.count = as_size(rows.size(0));
  model.bufferViews.push_back(view);
  model.accessors.push_back(accessor);
  return static_cast<int>(model.accessors.size()) - 1;
}

std::vector<double> as_doubles(const Tensor& row) {
  const Tensor values = row.to(torch::kFloat64).contiguous();
  return {values.data_ptr<double>(), values.data_ptr<double>() + values.numel()};
}

/// Colours and opacities of points: linear RGB and alpha. @return [M,4], 0 to 1
Tensor point_colours(const WrittenSplats& splats) {
  const Tensor encoded = (0.5 + kFirstHarmonic * splats.harmonics.select(1, 0)).clamp(0.0, 1.0);
  const Tensor linear = torch::where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055).pow(2.4));
  return torch::cat({linear, splats.opacities.sigmoid()}, 1);
}

tinygltf::Primitive splat_primitive(tinygltf::Model& model, const WrittenSplats& splats) {
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_POINTS;
  const auto add = [&](const std::string& name, const Tensor& values) {
    primitive.attributes[name] = add_attribute(model, values);
  };
  const std::string prefix = std::string(kSplatExtension) + ":";
  add("POSITION", splats.positions);
  model.accessors.back().minValues = as_doubles(splats.positions.amin(0));
  model.accessors.back().maxValues = as_doubles(splats.positions.amax(0));
  add("COLOR_0", point_colours(splats));
  add(prefix + "ROTATION", splats.rotations.roll(-1, 1));  // w x y z to x y z w
  add(prefix + "SCALE", splats.log_scales.exp());
  add(prefix + "OPACITY", splats.opacities.sigmoid());
  for (std::int64_t degree = 0, k = 0; k < splats.harmonics.size(1); ++degree)
    for (std::int64_t n = 0; n <= 2 * degree; ++n, ++k)
      add(fmt::format("{}SH_DEGREE_{}_COEF_{}", prefix, degree, n), splats.harmonics.select(1, k));
  const auto word = [](const char* text) { return tinygltf::Value(std::string(text)); };
  primitive.extensions[kSplatExtension] = tinygltf::Value(tinygltf::Value::Object{
      {"kernel", word("ellipse")},
      {"colorSpace", word("srgb_rec709_display")},
      {"projection", word("perspective")},
      {"sortingMethod", word("cameraDistance")},
  });
  return primitive;
}

tinygltf::Model splat_model(const WrittenSplats& splats) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "Doppel";
  model.extensionsUsed.emplace_back(kSplatExtension);
  model.buffers.emplace_back();
  tinygltf::Mesh mesh;
  mesh.primitives.push_back(splat_primitive(model, splats));
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
  check_written(action.c_str(), splats, item);
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
  check_written(action.c_str(), splats, item);
  const std::int64_t count = splats.positions.size(1), width = 15 + 3 * splats.harmonics.size(2);
  if (count > kMaxGlbBytes / (4 * width))
    fail("{}: {} Gaussians of {} bytes need {:.1f} GB, and a .glb file holds 4 GB; write fewer, or a .ply file", action,
         count, 4 * width, static_cast<double>(4 * width) * static_cast<double>(count) / 1e9);
  const tinygltf::Model model = splat_model(written_splats(action, splats, item));
  std::ostringstream stream;
  tinygltf::TinyGLTF writer;
  if (!writer.WriteGltfSceneToStream(&model, stream, /*prettyPrint=*/false, /*writeBinary=*/true))
    fail("{}: tinygltf refuses to write the Gaussians", action);
  write_atomically(file, stream.str());
}

}  // namespace doppel
