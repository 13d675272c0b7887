#pragma once

#include <torch/torch.h>

#include <cmath>
#include <vector>

/// A unit sphere of `rings` x `sectors` quads with UVs, for the examples.
struct Sphere {
  torch::Tensor vertices;    ///< [N,3]
  torch::Tensor faces;       ///< int32 [F,3]
  torch::Tensor corner_uvs;  ///< [F,3,2]
};

inline Sphere make_sphere(int rings = 12, int sectors = 24) {
  std::vector<float> points, uvs;
  std::vector<int> faces;
  const auto add = [&](int r, int s) {  // a corner of a face
    faces.push_back(r * (sectors + 1) + s);
    uvs.push_back(static_cast<float>(s) / static_cast<float>(sectors));
    uvs.push_back(1.0f - static_cast<float>(r) / static_cast<float>(rings));
  };
  for (int r = 0; r <= rings; ++r)
    for (int s = 0; s <= sectors; ++s) {
      const double tilt = M_PI * r / rings, turn = 2 * M_PI * s / sectors;
      for (const double c : {std::sin(tilt) * std::sin(turn), std::cos(tilt), std::sin(tilt) * std::cos(turn)})
        points.push_back(static_cast<float>(c));
    }
  for (int r = 0; r < rings; ++r)
    for (int s = 0; s < sectors; ++s) {
      add(r, s), add(r + 1, s), add(r + 1, s + 1);
      add(r, s), add(r + 1, s + 1), add(r, s + 1);
    }
  return {torch::tensor(points).view({-1, 3}), torch::tensor(faces, torch::kInt32).view({-1, 3}),
          torch::tensor(uvs).view({-1, 3, 2})};
}

/// Cameras around the origin, four metres away. @return [1,count,3,4] pixels from world metres
inline torch::Tensor make_cameras(int count, int size) {
  std::vector<torch::Tensor> cameras;
  for (int c = 0; c < count; ++c) {
    const float turn = 2.0f * static_cast<float>(M_PI) * static_cast<float>(c) / static_cast<float>(count);
    const float s = std::sin(turn), k = std::cos(turn), f = 1.5f * static_cast<float>(size),
                m = 0.5f * static_cast<float>(size);
    const torch::Tensor intrinsics = torch::tensor({f, 0.0f, m, 0.0f, f, m, 0.0f, 0.0f, 1.0f}).view({3, 3});
    const torch::Tensor view =
        torch::tensor({k, 0.0f, -s, 0.0f, 0.0f, -1.0f, 0.0f, 0.0f, -s, 0.0f, -k, 4.0f}).view({3, 4});
    cameras.push_back(intrinsics.matmul(view));
  }
  return torch::stack(cameras).unsqueeze(0);
}
