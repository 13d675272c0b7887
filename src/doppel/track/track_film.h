#pragma once

#include <torch/types.h>

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>

#include "doppel/data/video_file.h"
#include "doppel/geometry/camera.h"
#include "doppel/render/render_mesh.h"

namespace doppel {

/// A film of what was captured: the surface over the pictures of a camera and, beside it, the surface alone from the
/// person's side, where a wrong depth shows.
class TrackFilm {
 public:
  /// @param camera without distortion; the film is at most 720 lines high
  TrackFilm(const std::filesystem::path& path, const Camera& camera, const TriangleMesh& mesh,
            double frames_per_second);

  /// @param picture BGR, as the camera took it; empty: grey @param vertices float32 [N,3] world metres; undefined:
  /// nothing was captured
  void add(const cv::Mat& picture, const torch::Tensor& vertices);
  void close() { video_->close(); }

 private:
  cv::Mat draw(const torch::Tensor& vertices, const Camera& camera, const cv::Mat& behind) const;

  Camera camera_;
  RenderMesh mesh_;
  std::unique_ptr<VideoFile> video_;
};

/// The camera turned by a quarter about the upright line through `centre`, at its distance.
Camera seen_from_the_side(const Camera& camera, const Eigen::Vector3d& centre);

}  // namespace doppel
