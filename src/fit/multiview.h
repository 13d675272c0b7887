#pragma once

/// The multi-view fit (5.8, MVBL): the pose of each frame from the keypoints and masks of all cameras.
///
/// The fit of a frame starts at the pose predicted from the last frames. It fits the keypoints first, then keypoints
/// and outlines together. The first frame of a segment and a lost frame start from triangulated landmarks, so that no
/// initial pose is needed.

#include <memory>
#include <optional>
#include <vector>

#include "doppel/energy/evidence.h"
#include "doppel/energy/fit_problem.h"
#include "doppel/energy/outline.h"
#include "doppel/energy/pose_model.h"
#include "doppel/energy/triangulation.h"
#include "doppel/fit/pose_fit_options.h"
#include "doppel/fit/pose_history.h"
#include "doppel/fit/shared_dofs.h"
#include "doppel/fit/tracked_frame.h"

namespace doppel {

/// Options of the multi-view fit, in the units of `PoseFitOptions`. The weights of silhouette and contour are per
/// camera. The temporal term pulls landmarks to their predicted positions.
struct MultiviewOptions : PoseFitOptions {
  double silhouette_inside = 1.0;       ///< factor of the silhouette's weight for outline vertices inside the mask
  double contour_weight = 0.0;          ///< per squared reference pixel, each camera; with the silhouette's kernel
  double contour_reach = 60.0;          ///< reference pixels: largest distance of a contour pixel and its vertex
  int outline_rounds = 2;               ///< how often the surface's outline is found again in a frame
  double max_landmark_distance = 0.15;  ///< metres from the triangulated point; beyond, a new start is tried too
  SharedDofs shared_dofs;               ///< replace values of the rest pose
};

/// The image terms of a frame: keypoints and, where `outline` is not empty, silhouette and contour.
/// @param cameras, frame must outlive the terms
std::vector<std::unique_ptr<PoseTerm>> image_terms(const std::vector<PinholeCamera>& cameras,
                                                   const FrameEvidence& frame,
                                                   const std::vector<OutlineVertex>& outline,
                                                   const MultiviewOptions& options);

class MultiviewTracker {
 public:
  /// @param landmarks in the order of the keypoints
  /// @param dofs to find; the others keep the values of the shared DoFs and, without these, of the rest pose
  /// @throws UsageError for fewer than two cameras; Error for fewer than four landmarks or options out of range
  MultiviewTracker(const Character& character, const std::vector<Marker>& landmarks, const std::vector<int>& dofs,
                   std::vector<PinholeCamera> cameras, const MultiviewOptions& options = {});

  /// Tracks the next frame. @param frame [C], keypoints [M] each
  TrackedFrame track(const FrameEvidence& frame);
  /// The next frame begins a new segment.
  void cut() { history_.cut(); }
  /// Frames are missing before the next one: its pose is not predicted from earlier frames.
  void pause() { history_.clear(); }

  const PoseModel& model() const { return model_; }

 private:
  struct Fit;
  using Points = std::vector<std::optional<TriangulatedPoint>>;
  std::optional<std::vector<double>> start_anew(const Points& points) const;
  Fit fit(const FrameEvidence& frame, std::vector<double> start, const std::vector<double>* expected) const;
  std::vector<std::unique_ptr<PoseTerm>> terms(const FrameEvidence& frame, const std::vector<OutlineVertex>& outline,
                                               const std::vector<double>* expected) const;
  void judge(const FrameEvidence& frame, TrackedFrame& found) const;
  bool strays(const TrackedFrame& found, const Points& points) const;

  PoseModel model_;
  std::vector<PinholeCamera> cameras_;
  MultiviewOptions options_;
  OutlineFinder outlines_;
  std::vector<double> rigidity_;  ///< [M]
  std::vector<double> shared_;    ///< [D] the rest pose with the values of the shared DoFs
  PoseHistory history_;           ///< empty after a cut or a lost frame; begins with the pose `shared_`
};

}  // namespace doppel
