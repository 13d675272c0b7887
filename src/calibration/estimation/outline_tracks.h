#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// The convex hull of a person's mask in one frame.
struct Outline {
  struct Corner {
    Eigen::Vector2d pixel;   ///< as filmed
    bool on_border = false;  ///< at the border of the image, where the person may go on
  };
  std::vector<Corner> hull;  ///< convex in the image without distortion; empty: the camera does not see the person
};
/// [F] the outlines of one camera, numbered as the frames of its CameraTrack. Frames that nobody looked at are empty.
using OutlineTrack = std::vector<Outline>;

/// Checks that there are outlines of every camera, or none. @param purpose begins the message @throws UsageError
void check_outlines(const std::vector<Camera>& cameras, const std::vector<OutlineTrack>& outlines,
                    const std::string& purpose);

/// The outline of a mask to a fraction of a pixel: the hull of where the mask, slightly smoothed, falls to one half.
/// @param mask 8 bit, without lens distortion @param camera of the image as filmed, of the size of the mask
Outline outline_of(const cv::Mat& mask, const Camera& camera);

/// Frontier points of two cameras. Of all planes through both camera centres, the first and the last that meet the
/// person touch him at a point that both cameras see on their outlines (Sinha, Pollefeys and McMillan 2004). These
/// points need no detector, and masks show them to a fraction of a pixel. Convex hulls have the same tangents as masks.
class FrontierFinder {
 public:
  /// The cameras must live as long as the finder.
  FrontierFinder(const Camera& a, const Camera& b);

  /// Where camera a (`which` 0) or b (1) sees a frontier point, as filmed. Between two frames the tangents are
  /// interpolated. @param frame fractional @param side 0: of the first plane, 1: of the last
  /// @return nothing without an outline, where the person ends at the border of the image or is close to the image of
  /// the other camera's centre
  std::optional<Eigen::Vector2d> find(int which, const OutlineTrack& outlines, double frame, int side) const;

 private:
  std::optional<Eigen::Vector2d> tangent(int which, const Outline& outline, int side) const;

  std::array<const Camera*, 2> cameras_;
  /// From homogeneous pixels without distortion to the axes of the pencil: x across the baseline towards the person, z
  /// along the baseline.
  std::array<Eigen::Matrix3d, 2> pencil_from_pixel_;
  bool usable_ = false;  ///< the cameras do not look along the baseline
};

}  // namespace doppel
