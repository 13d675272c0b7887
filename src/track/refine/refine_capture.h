#pragma once

/// Pose, surface and texture of a tracked capture, registered by its images.
///
/// 1. Texture and template are learnt from some frames of the training sequences. In rounds: the textured surface is
/// drawn in
///    every camera; the optical flow from the drawing to the film gives matches of its vertices; each pose moves to
///    matches, outlines and keypoints; all frames together move the template (SurfaceOffset); and a new texture is
///    baked from the film, moved by the flow to where the surface is drawn, so that details do not average away.
/// 2. The poses of all frames of all sequences move to their matches with this texture and template, which stay fixed.
///
/// Frames of test sequences thus decide nothing but their own poses. Nothing is learnt from a frame whose pose
/// explains too few keypoints.

#include <filesystem>

#include "doppel/track/footage.h"
#include "doppel/track/refine/refine_frame.h"
#include "doppel/track/track_report.h"
#include "doppel/track/track_task.h"

namespace doppel {

struct RefineOptions : TrackTask {
  TrackConfig config;  ///< of it the weights of keypoints, outlines, limits and `steady`, solver, inliers and DoFs
  RefineWeights weights;
  int frames = 32;          ///< of the training sequences together, from which texture and template are learnt
  int rounds = 3;           ///< of drawing, poses, surface and texture; 0: texture and surface stay as they are
  int texture_size = 1024;  ///< texels along each side
  double smoothness = 8e5;  ///< of the template's offsets, per squared metre of an edge's difference and each frame
  int sheet_frames = 6;     ///< rows of `<sequence>.jpg`; 0: none
  double smoothing = 1.0;   ///< sigma of the Gaussian over the poses (`smooth_poses`, degree 2), frames; 0: none
};

/// Both steps. Writes into `options.out`: `character/`, `<sequence>.motion`, `<sequence>.bvh`, `capture.yaml` that
/// names them, `track.json`, the report that is returned, and `track.html`.
/// @throws Error for a character without UVs, or when a camera has no images; UsageError when there is no training
/// sequence, when a sequence has no motion, and for an unknown sequence
TrackReport refine_capture(const Footage& footage, const RefineOptions& options);

}  // namespace doppel
