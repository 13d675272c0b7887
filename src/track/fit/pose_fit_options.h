#pragma once

#include "doppel/core/options.h"
#include "doppel/solver/least_squares.h"

namespace doppel {

/// Options of every fit of a pose to keypoints and outlines, for any number of cameras. A weight of 0 switches a term
/// off. Pixels are reference pixels (image 1024 wide). Defaults are those of the multi-view fit.
struct PoseFitOptions {
  double keypoint_weight = 1.0;     ///< per squared pixel
  double keypoint_scale = 20.0;     ///< of the Geman-McClure kernel, pixels; 0: no kernel
  double silhouette_weight = 5.0;   ///< per squared pixel
  double silhouette_scale = 20.0;   ///< of the Geman-McClure kernel, pixels; 0: no kernel
  double limit_weight = 2000.0;     ///< per squared radian, DoFs beyond their limits
  double temporal_weight = 5000.0;  ///< per squared metre, positions of landmarks
  double steady_weight = 100.0;     ///< per squared radian, DoFs to their predicted values
  double prior_weight = 3.0;        ///< per squared radian, DoFs to the rest pose

  int outline_pixels = 256;    ///< side of the windows in which outlines are found
  int outline_vertices = 200;  ///< largest number of outline vertices per camera
  SolverOptions solver;        ///< of each fit

  double inlier_threshold = 40.0;  ///< largest distance of an inlier from its landmark, pixels
  double min_inlier_ratio = 0.5;   ///< inliers among the confident keypoints; below, the frame is lost
  int min_keypoints = 8;           ///< confident keypoints in a frame; below, the frame is not fitted
};

/// @throws Error for an option that is negative or not finite @param name of the option in the message
void check_not_negative(const char* name, double value);
/// @throws Error for options out of range
void check_fit(const PoseFitOptions& options);

/// The units of the numbers in a configuration.
struct ConfigUnits {
  const char* pixels = "pixels of an image 1024 wide";
  const char* squared_length = "squared metre";
  UnitConversion per_squared_pixel = same_unit;   ///< weights, to per squared reference pixel
  UnitConversion to_pixels = same_unit;           ///< lengths, to reference pixels
  UnitConversion per_squared_length = same_unit;  ///< weights, to per squared metre
};

/// The largest weight of a term.
constexpr double kMaxWeight = 1e12;

/// The keys that the configurations of all these fits share.
void describe_pose_fit(const Keys& keys, PoseFitOptions& options, const ConfigUnits& units = {});
/// The keys `iterations`, `damping` and `function_tolerance`.
void describe_keys(const Keys& keys, SolverOptions& options);

}  // namespace doppel
