// A small triangle drawer for the example: z-buffer, perspective-correct texture, one image in PPM format.
#pragma once

#include <torch/script.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "../host_files.h"

namespace draw {

constexpr int kSize = 512;

/// A camera that looks along -z at the middle of the vertices [N,3]. @return [1,3,4], pixels from world metres
inline torch::Tensor look_at(const torch::Tensor& vertices) {
  const torch::Tensor low = std::get<0>(vertices.min(0)), high = std::get<0>(vertices.max(0));
  const torch::Tensor middle = (low + high) / 2;
  const float distance = 1.6f * (high - low).max().item<float>();
  const torch::Tensor K =
      torch::tensor({1.3f * kSize, 0.f, kSize / 2.f, 0.f, 1.3f * kSize, kSize / 2.f, 0.f, 0.f, 1.f});
  const torch::Tensor R =
      torch::tensor({1.f, 0.f, 0.f, 0.f, -1.f, 0.f, 0.f, 0.f, -1.f}).view({3, 3});  // x right, y down
  const torch::Tensor t = torch::tensor({0.f, 0.f, distance}) - R.matmul(middle);
  return K.view({3, 3}).matmul(torch::cat({R, t.unsqueeze(1)}, 1)).unsqueeze(0);
}

/// @param vertices [N,3] @param texture [T,T,3] RGB 0..1, row 0 at v = 1 @param projection [3,4]
/// @param extra the actor's faces, uvs and face_uvs
inline void write_image(const std::string& path, const torch::Tensor& vertices, const torch::Tensor& texture,
                        const torch::Tensor& projection, torch::jit::ExtraFilesMap& extra) {
  const auto faces = host::numbers<int32_t>(extra["faces.npy"]),
             face_uvs = host::numbers<int32_t>(extra["face_uvs.npy"]);
  const auto uvs = host::numbers<float>(extra["uvs.npy"]);
  const torch::Tensor screen =
      (vertices.matmul(projection.slice(1, 0, 3).t()) + projection.select(1, 3)).contiguous();  // u z, v z, z
  const auto p = screen.accessor<float, 2>();
  const torch::Tensor texels = texture.contiguous();
  const auto colour = texels.accessor<float, 3>();
  const int side = static_cast<int>(texels.size(0));
  std::vector<float> depth(kSize * kSize, std::numeric_limits<float>::infinity());
  host::Image image(kSize, kSize, 230);
  for (size_t f = 0; f + 2 < faces.size(); f += 3) {
    double u[3], v[3], z[3];
    for (int k = 0; k < 3; ++k) {
      z[k] = p[faces[f + k]][2];
      u[k] = p[faces[f + k]][0] / z[k];
      v[k] = p[faces[f + k]][1] / z[k];
    }
    const double area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0]);
    if (std::min({z[0], z[1], z[2]}) <= 0 || area == 0) continue;
    const int x0 = std::max(0, int(std::floor(*std::min_element(u, u + 3)))),
              x1 = std::min(kSize - 1, int(*std::max_element(u, u + 3)));
    const int y0 = std::max(0, int(std::floor(*std::min_element(v, v + 3)))),
              y1 = std::min(kSize - 1, int(*std::max_element(v, v + 3)));
    for (int y = y0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x) {
        const double px = x + 0.5, py = y + 0.5;
        double b[3], sum = 0, s = 0, t = 0;
        for (int k = 0; k < 3; ++k) {
          const int i = (k + 1) % 3, j = (k + 2) % 3;
          b[k] = ((u[i] - px) * (v[j] - py) - (u[j] - px) * (v[i] - py)) / area;
        }
        if (std::min({b[0], b[1], b[2]}) < 0) continue;
        for (int k = 0; k < 3; ++k) sum += b[k] /= z[k];
        for (int k = 0; k < 3; ++k) {
          s += b[k] / sum * uvs[2 * face_uvs[f + k]];
          t += b[k] / sum * uvs[2 * face_uvs[f + k] + 1];
        }
        if (1 / sum >= depth[y * kSize + x]) continue;
        depth[y * kSize + x] = static_cast<float>(1 / sum);
        const int column = std::clamp(int(s * side), 0, side - 1), row = std::clamp(int((1 - t) * side), 0, side - 1);
        for (int c = 0; c < 3; ++c)
          image.at(x, y)[c] = static_cast<uint8_t>(std::lround(255 * std::clamp(colour[row][column][c], 0.f, 1.f)));
      }
  }
  host::write_ppm(path, image);
}

}  // namespace draw
