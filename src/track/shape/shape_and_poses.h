#pragma once

/// The shape of a body and its poses in some frames of a capture, found by turns: the poses with the shape fixed
/// (MultiviewTracker), then the shape with the poses fixed (fit_shape).

#include <string>
#include <vector>

#include "doppel/character/shape_family.h"
#include "doppel/core/progress.h"
#include "doppel/track/fit/track_config.h"
#include "doppel/track/footage.h"
#include "doppel/track/multiview/shape_fit.h"

namespace doppel {

/// What the cameras saw in some frames.
struct SeenFrames {
  /// A frame of a sequence.
  struct Sample {
    int sequence = 0;  ///< index in `Footage::sequences`
    long frame = 0;
  };
  std::vector<Sample> samples;      ///< [F] ascending
  std::vector<FrameEvidence> seen;  ///< [F]
};

/// About `count` frames, spread evenly over the sequences together, at least one of each. Advances by one a frame.
SeenFrames see_frames(const Footage& footage, const std::vector<FootageSequence>& sequences, int count,
                      Progress& progress);

/// How far keypoints lie from the projections of their triangulated landmarks: the median over landmarks, frames and
/// views, outliers included, reference pixels. Some pixels are usual; more means that calibration, synchronisation or
/// keypoints are off.
double triangulation_residual(const std::vector<PinholeCamera>& cameras, const SeenFrames& frames, int num_landmarks);

/// A character and its poses in some frames.
struct PosedFrames {
  std::vector<PosedEvidence> frames;        ///< those that are not lost
  std::vector<SeenFrames::Sample> samples;  ///< of `frames`
  double keypoint_error = 0.0;              ///< mean distance of the inliers, reference pixels
  double inlier_ratio = 0.0;                ///< inliers among the confident keypoints, mean over these frames
  double overlap = 0.0;                     ///< IoU of the skinned surface with the masks, mean; 0 without masks
};

/// The pose of each frame, each from its own triangulated landmarks.
/// @param landmarks [M] of the character, in the order of the keypoints @param config weights and DoFs
/// @throws Error when the poses of all frames are lost
PosedFrames find_poses(const Character& character, const std::vector<Marker>& landmarks,
                       const std::vector<PinholeCamera>& cameras, const SeenFrames& frames, const TrackConfig& config);

/// A character whose shape was fitted.
struct ShapedCharacter {
  std::vector<double> parameters;  ///< [P] of the family
  Character character;
  PosedFrames poses;
};

struct ShapeRounds {
  int rounds = 4;       ///< of poses and shape
  ShapeFitOptions fit;  ///< `images` are those of the TrackConfig
};

/// Finds shape and poses. The first shape comes from distances between triangulated landmarks.
/// @param landmarks [M] names of markers, in the order of the keypoints
/// Advances by one a round.
ShapedCharacter find_shape(const ShapeFamily& family, const std::vector<std::string>& landmarks,
                           const std::vector<PinholeCamera>& cameras, const SeenFrames& frames,
                           const TrackConfig& config, const ShapeRounds& rounds, Progress& progress);
/// The same in about `count` frames of sequences, for the landmarks of the footage. @param title of the progress
ShapedCharacter find_shape(const ShapeFamily& family, const Footage& footage,
                           const std::vector<FootageSequence>& sequences, const TrackConfig& config, int count,
                           const std::string& title);

}  // namespace doppel
