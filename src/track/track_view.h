#pragma once

#include <torch/types.h>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "doppel/geometry/camera.h"
#include "doppel/render/render_mesh.h"

namespace doppel {

struct TrackViewOptions {
  cv::Mat texture;        ///< 8-bit BGR, drawn on the surface by the mesh's UVs (virtual try-on); empty: plain grey
  int highest = 720;      ///< lines of the image, at most
  int supersampling = 2;  ///< of each pixel's side
  double angle = 90.0;    ///< degrees that the second view is turned by
};

/// Two images beside each other: the surface over what a camera took, and the surface alone from elsewhere. From the
/// person's side a wrong depth shows.
class TrackView {
 public:
  /// @param camera without distortion
  /// @throws UsageError for a texture on a mesh without UVs
  TrackView(const Camera& camera, const TriangleMesh& mesh, const TrackViewOptions& options = {});

  /// Of `draw`: even sides.
  cv::Size size() const { return {2 * camera_.width, camera_.height}; }
  /// @param image BGR, as the camera took it; empty: grey @param vertices float32 [N,3] world metres; undefined:
  /// nothing was captured @return 8-bit BGR
  cv::Mat draw(const cv::Mat& image, const torch::Tensor& vertices) const;
  /// Turns the second view. @param degrees
  void turn(double degrees) { options_.angle += degrees; }

 private:
  cv::Mat draw_surface(const torch::Tensor& vertices, const Camera& camera, const cv::Mat& behind) const;

  Camera camera_;
  RenderMesh mesh_;
  TrackViewOptions options_;
  torch::Tensor texture_;  ///< [1,Th,Tw,3]; undefined without one
};

/// [3,N] as float32 [N,3].
torch::Tensor tensor_of_vertices(const Eigen::Matrix3Xd& vertices);

/// The camera turned about the upright line through `centre`, at its distance. @param angle radians
Camera turned_about(const Camera& camera, const Eigen::Vector3d& centre, double angle);

}  // namespace doppel
