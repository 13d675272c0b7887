#include "doppel/track/surface/surface_viewer.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/track/energy/drawn_outline.h"

namespace doppel {
namespace {

constexpr float kOcclusionTolerance = 0.02f;  // metres, so that a slanted surface does not occlude itself

torch::Tensor to_tensor(const Eigen::Matrix3Xd& vertices) {
  torch::Tensor result = torch::empty({1, vertices.cols(), 3});
  Eigen::Map<Eigen::Matrix3Xf>(result.data_ptr<float>(), 3, vertices.cols()) = vertices.cast<float>();
  return result;
}

}  // namespace

struct SurfaceViewer::State {
  PinholeCamera camera;
  int pixels;
  torch::Tensor faces;  ///< int32 [F,3]
  Rasterizer rasterizer;
  std::vector<char> vertex_parts, face_parts;

  State(const Character& character, const PinholeCamera& camera_in, int pixels_in)
      : camera(camera_in),
        pixels(pixels_in),
        faces(RenderMesh(character.mesh).faces),
        rasterizer(faces),
        vertex_parts(body_parts(character.skin)) {
    for (const Triangle& face : character.mesh.faces) face_parts.push_back(vertex_parts[face[0]]);
  }

  cv::Mat parts(const int* face_id) const {
    cv::Mat result(pixels, pixels, CV_8UC1);
    for (int i = 0; i < pixels * pixels; ++i)
      result.data[i] = face_id[i] < 0 ? 0 : static_cast<unsigned char>(face_parts[face_id[i]]);
    return result;
  }
};

SurfaceViewer::SurfaceViewer(const Character& character, const PinholeCamera& camera, int pixels)
    : state_(new State(character, camera, pixels)) {}
SurfaceViewer::~SurfaceViewer() = default;

const std::vector<char>& SurfaceViewer::vertex_parts() const { return state_->vertex_parts; }

SurfaceView SurfaceViewer::look(const PosedSurface& surface, const CropBox& window, double growth) {
  const torch::NoGradGuard no_grad;
  const int pixels = state_->pixels;
  const PinholeCamera camera = crop_camera(state_->camera, window, pixels);
  const RasterImage& image = state_->rasterizer.rasterize_projected(
      to_tensor(surface.vertices), projection_tensor({camera}).unsqueeze(0), pixels, pixels);
  const int* face_id = image.face_id.data_ptr<int>();
  const float* depth = image.depth.data_ptr<float>();
  const auto count = as_size(surface.vertices.cols());
  const Eigen::Vector3d centre = camera.centre();
  const double reference = reference_pixels(state_->camera) * window.image_pixels_per_pixel(pixels);
  const DrawnOutline drawn(cv::Mat(pixels, pixels, CV_32S, image.face_id.data_ptr<int>()) >= 0);
  SurfaceView view;
  view.visible.assign(count, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d vertex = surface.vertices.col(static_cast<Eigen::Index>(i));
    const Eigen::Vector3d seen = camera.K * camera.camera_from_world(vertex);
    if (!(seen.z() > 0.0)) continue;
    const double u = seen.x() / seen.z(), v = seen.y() / seen.z();
    if (!(u >= 1.0 && v >= 1.0 && u < pixels - 1 && v < pixels - 1)) continue;
    const int column = static_cast<int>(u), row = static_cast<int>(v);
    view.visible[i] = surface.normals[i].dot(centre - vertex) > 0.0 &&
                      depth[row * pixels + column] >= static_cast<float>(seen.z()) - kOcclusionTolerance;
    if (drawn.holds(u, v)) view.outline.push_back({0, static_cast<int>(i), reference * drawn.distance(u, v)});
  }
  const int grown = static_cast<int>(std::lround(growth / window.image_pixels_per_pixel(pixels)));
  view.parts = PartMask(state_->parts(face_id), window, std::max(1, grown));
  return view;
}

double SurfaceViewer::overlap(const Eigen::Matrix3Xd& vertices, const cv::Mat& mask) {
  const torch::NoGradGuard no_grad;
  torch::Tensor covered =
      state_->rasterizer.coverage_projected(to_tensor(vertices), projection_tensor({state_->camera}).unsqueeze(0),
                                            state_->camera.height, state_->camera.width);
  const cv::Mat drawn(state_->camera.height, state_->camera.width, CV_8UC1, covered.data_ptr());
  const int both = cv::countNonZero(drawn & (mask > 0)), either = cv::countNonZero(drawn | mask);
  return either > 0 ? static_cast<double>(both) / either : 0.0;
}

}  // namespace doppel
