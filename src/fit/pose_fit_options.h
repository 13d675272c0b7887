#pragma once

#include "doppel/core/config.h"
#include "doppel/solver/least_squares.h"

namespace doppel {

/// What every fit of a pose to keypoints and outlines can be told, whatever the number of cameras. A term of weight 0
/// is switched off. Which unit a pixel and a metre have is the fit's own; these defaults count pixels of an image 1024
/// wide, metres and radians.
struct PoseFitOptions {
  double keypoint_weight = 1.0;
  double keypoint_scale = 20.0;  ///< of the Geman-McClure kernel, pixels
  double silhouette_weight = 5.0;
  double silhouette_scale = 20.0;  ///< of the Geman-McClure kernel, pixels
  double limit_weight = 2000.0;
  double temporal_weight = 5000.0;  ///< of landmarks
  double steady_weight = 100.0;     ///< DoFs to where the last frames lead
  double prior_weight = 3.0;        ///< DoFs to the rest pose

  int outline_pixels = 256;    ///< side of the windows that outlines are looked for in
  int outline_vertices = 200;  ///< of a camera, at most
  SolverOptions solver;        ///< of each fit

  double inlier_threshold = 40.0;  ///< pixels between a landmark and its keypoint, up to which the keypoint is an inlier
  double min_inlier_ratio = 0.5;  ///< inliers among the confident keypoints; below, the fit is lost
  int min_keypoints = 8;     ///< confident ones in a frame; below, the frame is not fitted
};

/// @throws Error for a number of a fit that is negative or not finite @param name as the message calls it
void check_not_negative(const char* name, double value);
/// @throws Error for options out of range
void check_fit(const PoseFitOptions& options);
/// The keys that the configurations of all such fits have in common; a missing one leaves its option as it is.
/// @throws FileError for impossible values
void read_pose_fit(const ConfigReader& root, PoseFitOptions& options);

}  // namespace doppel
