#include "render/bench_mesh.h"

#include <torch/types.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

namespace doppel::bench {
namespace {

using torch::Tensor;

Tensor centred(const Tensor& x) { return x - 0.5 * (x.amax(0) + x.amin(0)); }

/// Rings of a capsule with bumps: 52 rings x 106 columns + 2 poles = 11,024 faces.
BenchMesh bumpy_capsule() {
  constexpr int kRings = 52, kColumns = 106;
  std::vector<float> points{0, 0.88f, 0, 0, -0.88f, 0};
  std::vector<int> faces;
  for (int r = 0; r < kRings; ++r) {
    for (int c = 0; c < kColumns; ++c) {
      const double theta = M_PI * (r + 1) / (kRings + 1), phi = 2 * M_PI * c / kColumns;
      const double bump = 1 + 0.12 * std::sin(5 * phi) * std::sin(9 * theta) + 0.05 * std::cos(11 * phi + 4 * theta);
      const double radius = 0.24 * std::pow(std::sin(theta), 0.4) * bump;
      points.insert(points.end(),
                    {static_cast<float>(radius * std::sin(phi)), static_cast<float>(0.88 * std::cos(theta)),
                     static_cast<float>(radius * std::cos(phi))});
    }
  }
  const auto id = [](int r, int c) { return 2 + r * kColumns + c % kColumns; };
  for (int c = 0; c < kColumns; ++c) {
    faces.insert(faces.end(), {0, id(0, c), id(0, c + 1), 1, id(kRings - 1, c + 1), id(kRings - 1, c)});
    for (int r = 0; r + 1 < kRings; ++r) {
      faces.insert(faces.end(), {id(r, c), id(r + 1, c), id(r + 1, c + 1), id(r, c), id(r + 1, c + 1), id(r, c + 1)});
    }
  }
  std::vector<float> uvs;
  for (const int i : faces) {
    const int column = (i - 2) % kColumns, row = (i - 2) / kColumns;
    const bool pole = i < 2;
    uvs.push_back(pole ? 0.5f : static_cast<float>(column) / kColumns);
    uvs.push_back(pole ? static_cast<float>(1 - i) : 1 - static_cast<float>(row + 1) / (kRings + 1));
  }
  return {"bumpy capsule", centred(torch::tensor(points).reshape({-1, 3})),
          torch::tensor(faces, torch::kInt32).reshape({-1, 3}), torch::tensor(uvs).reshape({-1, 3, 2})};
}

}  // namespace

BenchMesh bench_mesh() {
  const char* shared = std::getenv("DOPPEL_SHARED");
  const std::filesystem::path path = std::filesystem::path(shared ? shared : "") / "captures/s22/character/ddc.obj";
  if (!shared || !std::filesystem::exists(path)) return bumpy_capsule();
  const TriangleMesh mesh = read_obj(path, 0.001);
  std::vector<double> points;
  for (const Eigen::Vector3d& v : mesh.vertices) points.insert(points.end(), {v.x(), v.y(), v.z()});
  std::vector<int> faces;
  for (const Triangle& f : mesh.faces) faces.insert(faces.end(), f.begin(), f.end());
  std::vector<double> uvs;
  for (const Triangle& f : mesh.face_uvs) {
    for (const int i : f) {
      const Eigen::Vector2d& uv = mesh.uvs[i];
      uvs.insert(uvs.end(), {uv.x(), uv.y()});
    }
  }
  return {"ddc.obj", centred(torch::tensor(points, torch::kFloat64).reshape({-1, 3})).to(torch::kFloat32),
          torch::tensor(faces, torch::kInt32).reshape({-1, 3}),
          torch::tensor(uvs, torch::kFloat64).to(torch::kFloat32).reshape({-1, 3, 2})};
}

TriangleMesh triangle_mesh(const BenchMesh& mesh) {
  TriangleMesh result;
  const auto vertices = mesh.vertices.accessor<float, 2>();
  for (std::int64_t i = 0; i < vertices.size(0); ++i)
    result.vertices.emplace_back(vertices[i][0], vertices[i][1], vertices[i][2]);
  const auto faces = mesh.faces.accessor<int, 2>();
  for (std::int64_t f = 0; f < faces.size(0); ++f) result.faces.push_back({faces[f][0], faces[f][1], faces[f][2]});
  return result;
}

Tensor bench_views(const BenchMesh& mesh, int num_views) {
  std::vector<Tensor> views;
  for (int k = 0; k < num_views; ++k) {
    const double angle = k * M_PI / 4, s = std::sin(angle), c = std::cos(angle);
    const Tensor rotation = torch::tensor({-c, 0.0, -s, 0.0, -1.0, 0.0, -s, 0.0, c}, torch::kFloat64).reshape({3, 3});
    views.push_back(torch::matmul(mesh.vertices.to(torch::kFloat64), rotation.t()) +
                    torch::tensor({0.0, 0.0, 4.0}, torch::kFloat64));
  }
  return torch::stack(views).to(torch::kFloat32).contiguous();
}

}  // namespace doppel::bench
