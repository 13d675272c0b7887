#include "doppel/rigging/autorig/draw_scan.h"

#include <torch/types.h>

#include <algorithm>
#include <cmath>

#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/raster/rasterizer.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

constexpr double kFieldOfView = 0.45;               // tangent of half the angle of view
constexpr double kMargin = 1.2;                     // the person fills the image less a border
const cv::Vec3b kWall(195, 190, 190);               // BGR
const Vector3d kClay(0.69, 0.51, 0.43);             // RGB
const Vector3d kLampInCamera(-0.40, -0.69, -0.60);  // direction towards the lamp
constexpr double kAmbient = 0.35;

}  // namespace

std::vector<PinholeCamera> cameras_around(const Eigen::AlignedBox3d& box, int count, double elevation, double phase,
                                          int size) {
  const Vector3d middle = box.center(), extent = box.sizes();
  const double height = std::max(extent.y(), std::hypot(extent.x(), extent.z()));
  const double distance = 0.5 * kMargin * height / kFieldOfView + 0.5 * std::hypot(extent.x(), extent.z());
  const double focal_length = 0.5 * size / kFieldOfView;
  std::vector<PinholeCamera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.0 * M_PI * (i + phase) / count;
    const Vector3d away(std::sin(angle) * std::cos(elevation), std::sin(elevation),
                        std::cos(angle) * std::cos(elevation));
    const Vector3d z = -away, x = Vector3d(0, -1, 0).cross(z).normalized();
    PinholeCamera camera;
    camera.name = "view" + std::to_string(i);
    camera.width = camera.height = size;
    camera.K << focal_length, 0, 0.5 * size, 0, focal_length, 0.5 * size, 0, 0, 1;
    camera.R.row(0) = x;
    camera.R.row(1) = z.cross(x);
    camera.R.row(2) = z;
    camera.t = -camera.R * (middle + distance * away);
    cameras.push_back(camera);
  }
  return cameras;
}

struct ScanPainter::Impl {
  explicit Impl(const TriangleMesh& surface)
      : mesh(surface), normals(vertex_normals(surface)), rasterizer(face_tensor(surface)) {}

  torch::Tensor vertices_in(const PinholeCamera& camera) const {
    torch::Tensor result = torch::empty({1, mesh.num_vertices(), 3});
    auto rows = result.accessor<float, 3>();
    for (int v = 0; v < mesh.num_vertices(); ++v) {
      const Vector3d point = camera.camera_from_world(mesh.vertices[v]);
      for (int k = 0; k < 3; ++k) rows[0][v][k] = static_cast<float>(point[k]);
    }
    return result;
  }

  /// The colour of the surface without light, RGB 0..1. @param w barycentrics of the face
  Vector3d albedo(int face, const Vector3d& w) const {
    if (!mesh.texture.empty() && !mesh.face_uvs.empty()) {
      Eigen::Vector2d uv(0, 0);
      for (int k = 0; k < 3; ++k) uv += w[k] * mesh.uvs[mesh.face_uvs[face][k]];
      const int x = std::clamp(static_cast<int>(uv.x() * mesh.texture.cols), 0, mesh.texture.cols - 1);
      const int y = std::clamp(static_cast<int>((1.0 - uv.y()) * mesh.texture.rows), 0, mesh.texture.rows - 1);
      const cv::Vec3b texel = mesh.texture.at<cv::Vec3b>(y, x);
      return Vector3d(texel[2], texel[1], texel[0]) / 255.0;
    }
    if (mesh.colours.empty()) return kClay;
    Vector3d colour(0, 0, 0);
    for (int k = 0; k < 3; ++k) colour += w[k] * mesh.colours[mesh.faces[face][k]];
    return colour;
  }

  /// @param lamp unit vector towards the lamp, world @param towards the camera, world
  cv::Vec3b shade(int face, const Vector3d& w, const Vector3d& lamp, const Vector3d& towards) const {
    Vector3d normal(0, 0, 0);
    for (int k = 0; k < 3; ++k) normal += w[k] * normals[mesh.faces[face][k]];
    if (normal.dot(towards) < 0) normal = -normal;
    const double light = kAmbient + (1.0 - kAmbient) * std::max(0.0, normal.normalized().dot(lamp));
    const Vector3d colour = 255.0 * light * albedo(face, w);
    return {cv::saturate_cast<uchar>(colour.z()), cv::saturate_cast<uchar>(colour.y()),
            cv::saturate_cast<uchar>(colour.x())};
  }

  const TriangleMesh& mesh;
  std::vector<Vector3d> normals;
  Rasterizer rasterizer;
};

ScanPainter::ScanPainter(const TriangleMesh& mesh) : impl_(std::make_unique<Impl>(mesh)) {}
ScanPainter::~ScanPainter() = default;

cv::Mat ScanPainter::draw(const PinholeCamera& camera) {
  const torch::Tensor intrinsics =
      torch::tensor({camera.K(0, 0), camera.K(1, 1), camera.K(0, 2), camera.K(1, 2)}, torch::kFloat32).unsqueeze(0);
  const RasterImage& drawn =
      impl_->rasterizer.rasterize(impl_->vertices_in(camera), intrinsics, camera.height, camera.width);
  const auto faces = drawn.face_id.accessor<int, 3>();
  const auto barycentrics = drawn.barycentrics.accessor<float, 4>();
  const Vector3d lamp = camera.R.transpose() * kLampInCamera.normalized();
  const Vector3d towards = -camera.R.row(2).transpose();
  cv::Mat image(camera.height, camera.width, CV_8UC3, cv::Scalar(kWall));
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const int face = faces[0][y][x];
      if (face < 0) continue;
      const auto w = barycentrics[0][y][x];
      image.at<cv::Vec3b>(y, x) = impl_->shade(face, {w[0], w[1], w[2]}, lamp, towards);
    }
  return image;
}

}  // namespace doppel
