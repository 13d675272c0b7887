#include "doppel/render/texture/texture_space_kernel.h"

#include "doppel/render/simd.h"

namespace doppel::kernels::DOPPEL_ISA {
namespace {

constexpr float kTinyNormal = 1e-30f;  // square of a length in square metres

inline void clear(const TexelTable& table, std::int64_t begin, std::int64_t end, float* map) {
  for (int d = 0; d < 3; ++d)
    std::memset(map + d * table.map_size + begin, 0, static_cast<std::size_t>(end - begin) * sizeof(float));
}

/// Up to kLanes texels of a run.
inline void write_texels(const TexelTable& table, const float* normals, std::int64_t first, int count, float* map) {
  alignas(64) std::int32_t corner[kLanes];
  alignas(64) float weight[kLanes];
  Float sum[3] = {Float{}, Float{}, Float{}};
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < kLanes; ++i) {
      const std::int64_t q = k * table.num_texels + first + (i < count ? i : 0);
      corner[i] = table.corners[q];
      weight[i] = table.weights[q];
    }
    Float x, y, z, unused;
    load_records(normals, corner, x, y, z, unused);
    const Float w = load<Float>(weight);
    sum[0] += w * x;
    sum[1] += w * y;
    sum[2] += w * z;
  }
  const Float square = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
  const Int solid = square > kTinyNormal;
  const Float scale = solid ? 1.0f / square_root(solid ? square : splat(1.0f)) : Float{};
  for (int d = 0; d < 3; ++d) {
    const Float value = sum[d] * scale;
    std::memcpy(map + d * table.map_size, &value, static_cast<std::size_t>(count) * sizeof(float));
  }
}

}  // namespace

void texel_normals(const TexelTable& table, const float* normals, std::int64_t begin, std::int64_t end, float* map) {
  const auto first_of = [&](std::int64_t run) {
    return run < table.num_runs ? table.runs[2 * run + 1] : table.num_texels;
  };
  for (std::int64_t run = begin; run < end; ++run) {
    const std::int64_t texel = table.runs[2 * run], first = first_of(run), count = first_of(run + 1) - first;
    const std::int64_t before = run == 0 ? 0 : table.runs[2 * run - 2] + first - first_of(run - 1);
    clear(table, before, texel, map);
    for (std::int64_t i = 0; i < count; i += kLanes)
      write_texels(table, normals, first + i, static_cast<int>(count - i < kLanes ? count - i : kLanes),
                   map + texel + i);
    if (run + 1 == table.num_runs) clear(table, texel + count, table.map_size, map);
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
