#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/track/shape/shape_and_poses.h"

namespace doppel {

struct FitCharacterOptions {
  std::vector<std::string> sequences;  ///< names; empty: those for training, or all where there are none
  int frames = 24;                     ///< that the body is fitted to, of all sequences together
  int bends = 8;                       ///< how often the surface is bent to the outlines at most; 0 without masks
  int texture_size = 1024;             ///< texels along each side; 0: no texture
  int sheet_frames = 4;                ///< rows of the contact sheet
  TrackConfig config;                  ///< of poses and surface
  ShapeRounds shape;

  /// Outlines count more than in tracking by default, and keypoints less: keypoints are off in the same way in all
  /// frames, so a body that follows them is off, too. Finer outlines make the body more accurate. The
  /// temporal terms are weakened like the keypoints, so that an arm with a hidden outline still follows its keypoints.
  FitCharacterOptions() {
    config.fit.keypoint_weight = 0.3;
    config.fit.temporal_weight = 1500.0;
    config.fit.steady_weight = 30.0;
    config.fit.silhouette_weight = 100.0;
    config.fit.outline_pixels = 512;
    config.fit.outline_vertices = 600;
  }
};

/// A character made from a capture.
struct FittedCharacter {
  Character character;
  std::vector<double> parameters;  ///< [P] of the family, before the surface was bent
  std::vector<Marker> landmarks;   ///< [M] where on the body the detector sees them, in the order of the keypoints
  PosedFrames poses;               ///< of the final character
  double measured_overlap = 0.0;   ///< IoU with the masks before the surface was bent
  double texture_coverage = 0.0;   ///< share of the texels that an image showed
  cv::Mat sheet;                   ///< contact sheet, 8-bit BGR (TrackSheet)
};

/// Makes the character of a filmed person without a scan: the shape of a family that fits keypoints and outlines of
/// many frames best, then the positions of the detector's landmarks on this body (LandmarkPositions), then a template
/// that is bent to the outlines of all these frames by the embedded graph, then a texture from their images.
/// @param footage of a capture with keypoints, opened for a character of the family; masks and images are used where
///   there are any
/// @throws UsageError for an unknown sequence; Error when no frame can be fitted
FittedCharacter fit_character(const ShapeFamily& family, const Footage& footage, const FitCharacterOptions& options);

}  // namespace doppel
