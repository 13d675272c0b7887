#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "doppel/detect/blazepose/body_detector.h"
#include "doppel/geometry/camera.h"
#include "doppel/geometry/mesh.h"

namespace doppel {

struct BodyPointsOptions {
  int views_per_ring = 16;  ///< two rings: level with the middle of the body, and above it
  int image_size = 512;     ///< pixels
  BodyDetectorOptions detector{.masks = false};
};

/// What the detector saw in one image of the scan.
struct ScanView {
  PinholeCamera camera;
  cv::Mat image;                 ///< 8-bit BGR
  std::optional<BodyPose> pose;  ///< nothing when no person was found
  int people = 0;                ///< found far from each other
};

/// BlazePose's landmarks of a scan, in space.
struct BodyPoints {
  /// Metres, in the mesh's frame; nothing where fewer than three views agree.
  std::array<std::optional<Eigen::Vector3d>, kNumBodyLandmarks> positions;
  std::array<double, kNumBodyLandmarks> error{};       ///< root mean square residual of the inlier views, metres
  std::array<double, kNumBodyLandmarks> visibility{};  ///< mean over the views
  std::vector<ScanView> views;

  int views_with_person() const;
};

/// Draws the scan from cameras around it, runs BlazePose on the images, and triangulates the landmarks. Whether a
/// person is there at all is for the caller to judge.
/// @param mesh metres, y up
BodyPoints find_body_points(const TriangleMesh& mesh, const BodyPointsOptions& options = {});

}  // namespace doppel
