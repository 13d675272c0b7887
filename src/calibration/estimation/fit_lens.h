#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// The corners of a board that one camera saw at one instant, for OpenCV.
struct LensView {
  long instant = 0;
  std::vector<cv::Point3f> board;
  std::vector<cv::Point2f> image;
};

/// One run of OpenCV's calibration.
struct LensFit {
  cv::Mat K, distortion;
  std::vector<double> errors;  ///< root mean square of each view, pixels
  double rms = 0.0;
  double focal_sigma = 0.0;    ///< standard deviation, pixels
  double tilt = 0.0;           ///< largest angle between the image and a board, radians
  double largest_angle = 0.0;  ///< between the optical axis and a corner, radians
};

/// Intrinsics and distortion by cv::calibrateCamera or cv::fisheye::calibrate. Coefficients that the corners do not
/// determine stay 0: k3 of a lens `opencv`; k3 and k4 of a fisheye lens unless the corners reach far from the axis.
/// @throws cv::Exception when OpenCV finds no solution
LensFit fit_lens(const std::vector<LensView>& views, const cv::Size& size, Lens lens);

/// The angle from the optical axis of the farthest corner of the image, radians; pi/2 when no direction in front of the
/// camera is seen there.
double angle_of_image_corner(const Camera& camera);
/// The smallest angle from the optical axis, radians, beyond which the lens turns back: directions farther from the
/// axis are drawn nearer to the middle of the image. Nothing when the image ends before.
std::optional<double> angle_of_turning_back(const Camera& camera);

}  // namespace doppel
