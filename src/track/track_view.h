#pragma once

#include <torch/types.h>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "doppel/geometry/camera.h"
#include "doppel/render/mesh/render_mesh.h"

namespace doppel {

/// A BGRA image composited over another one.
/// @param over 8-bit BGRA; an image without alpha is returned as it is
/// @param under 8-bit BGR of any size, scaled to that of `over`; empty: grey
/// @return 8-bit BGR
cv::Mat composite(const cv::Mat& over, const cv::Mat& under);

struct TrackViewOptions {
  /// Drawn on the surface by the mesh's UVs (virtual try-on): 8-bit BGR, or BGRA that is composited over the texture of
  /// the template, for example a logo. Empty: plain grey.
  cv::Mat texture;
  int highest = 720;      ///< largest height of the image, pixels
  int supersampling = 2;  ///< samples per pixel and direction
  double angle = 90.0;    ///< rotation of the second view, degrees
};

/// Two images side by side: the surface over the image of a camera, and the surface alone from a second viewpoint. A
/// view from the person's side shows errors of depth.
class TrackView {
 public:
  /// @throws UsageError for a texture on a mesh without UVs
  TrackView(const PinholeCamera& camera, const TriangleMesh& mesh, const TrackViewOptions& options = {});

  /// The size of the images of `draw`; both sides are even.
  cv::Size size() const { return {2 * camera_.width, camera_.height}; }
  /// @param image BGR, as the camera took it; empty: grey
  /// @param vertices float32 [N,3] world metres; undefined: no surface is drawn
  /// @return 8-bit BGR
  cv::Mat draw(const cv::Mat& image, const torch::Tensor& vertices) const;
  /// Rotates the second view. @param degrees
  void turn(double degrees) { options_.angle += degrees; }

 private:
  cv::Mat draw_surface(const torch::Tensor& vertices, const PinholeCamera& camera, const cv::Mat& behind) const;

  PinholeCamera camera_;
  RenderMesh mesh_;
  TrackViewOptions options_;
  torch::Tensor texture_;  ///< [1,Th,Tw,3]; undefined without one
};

/// Converts [3,N] to float32 [N,3].
torch::Tensor tensor_of_vertices(const Eigen::Matrix3Xd& vertices);

/// The camera rotated about the vertical axis through `centre`. @param angle radians
PinholeCamera turned_about(const PinholeCamera& camera, const Eigen::Vector3d& centre, double angle);

}  // namespace doppel
