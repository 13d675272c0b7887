#include "doppel/actor/export/splat_primitive.h"

#include <fmt/format.h>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {
namespace {

using torch::Tensor;

/// @param values float32 [M,W], W = 1, 3 or 4 @return the accessor
int add_attribute(GlbBuffer& buffer, const Tensor& values, bool bounds) {
  const Tensor rows = values.contiguous();
  return buffer.floats({rows.data_ptr<float>(), as_size(rows.numel())}, static_cast<int>(rows.size(1)), bounds,
                       TINYGLTF_TARGET_ARRAY_BUFFER);
}

/// Colours and opacities of points: linear RGB and alpha. @return [M,4], 0 to 1
Tensor point_colours(const WrittenSplats& splats) {
  const Tensor encoded = (0.5 + kFirstHarmonic * splats.harmonics.select(1, 0)).clamp(0.0, 1.0);
  const Tensor linear = torch::where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055).pow(2.4));
  return torch::cat({linear, splats.opacities.sigmoid()}, 1);
}

}  // namespace

void check_written(const std::string& action, const Splats& splats, std::int64_t item) {
  check_floats(action.c_str(), "positions", splats.positions, {-1, -1, 3}, "[B,N,3]");
  check_splats(action.c_str(), splats);
  const std::int64_t batch = splats.positions.size(0);
  if (item < 0 || item >= batch)
    fail<UsageError>("{}: batch item {} was asked for, and the Gaussians have {} items, counted from 0", action, item,
                     batch);
}

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
  return {
      kept(positions), kept(normals), kept(rotations / lengths).to(torch::kFloat32), kept(log_scales), kept(opacities),
      kept(harmonics), index};
}

tinygltf::Primitive splat_primitive(GlbBuffer& buffer, const WrittenSplats& splats) {
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_POINTS;
  const auto add = [&](const std::string& name, const Tensor& values, bool bounds = false) {
    primitive.attributes[name] = add_attribute(buffer, values, bounds);
  };
  const std::string prefix = std::string(kSplatExtension) + ":";
  add("POSITION", splats.positions, /*bounds=*/true);
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

}  // namespace doppel
