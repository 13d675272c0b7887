#pragma once

/// The multi-view fit (5.8, MVBL): the pose of each frame from the keypoints and masks of all cameras.
///
/// A frame starts where the last ones lead to. First the keypoints are fitted, then keypoints and outlines together.
/// The first frame of a segment, and one whose fit was lost, starts from landmarks placed in the world by triangulation
/// instead, so no pose need be given.

#include <memory>
#include <optional>
#include <vector>

#include "doppel/energy/evidence.h"
#include "doppel/energy/fit_problem.h"
#include "doppel/energy/outline.h"
#include "doppel/fit/pose_fit_options.h"
#include "doppel/fit/pose_history.h"
#include "doppel/energy/pose_model.h"
#include "doppel/fit/tracked_frame.h"
#include "doppel/energy/triangulation.h"
#include "doppel/fit/shared_dofs.h"

namespace doppel {

/// Weights are per squared reference pixel, metre or radian. The silhouette's weight is that of each camera; landmarks
/// are drawn to where the last frames lead.
struct MultiviewOptions : PoseFitOptions {
  double silhouette_inside = 1.0;   ///< share of the silhouette's weight that an outline within the mask counts
  double contour_weight = 0.0;      ///< of each camera: the mask's outline to the surface's, kernel as the silhouette's
  double contour_reach = 60.0;      ///< reference pixels: farther apart they do not belong together
  int outline_rounds = 2;           ///< how often the outline of the model is found anew in a frame
  double max_landmark_distance = 0.15;  ///< metres from its triangulated point: beyond, a new start is tried as well
  SharedDofs shared_dofs;                  ///< what stands in the place of the rest pose
};

/// The terms of what a frame shows: keypoints and, given its outline, both ways between the outlines of surface and
/// mask. @param cameras, frame must outlive the terms
std::vector<std::unique_ptr<PoseTerm>> image_terms(const std::vector<Camera>& cameras, const FrameEvidence& frame,
                                                   const std::vector<OutlineVertex>& outline,
                                                   const MultiviewOptions& options);

class MultiviewTracker {
 public:
  /// @param landmarks in the order of the keypoints; @param dofs to be found, the others keep the values of the rest pose with the shared DoFs in it
  /// @param cameras without distortion
  /// @throws UsageError for fewer than two cameras; Error for fewer than four landmarks, options out of range
  MultiviewTracker(const Character& character, const std::vector<Marker>& landmarks, const std::vector<int>& dofs,
                   std::vector<Camera> cameras, const MultiviewOptions& options = {});

  /// The next frame. @param frame [C], keypoints [M] each
  TrackedFrame track(const FrameEvidence& frame);
  /// The next frame begins a new segment.
  void cut() { history_.cut(); }
  /// Frames are missing before the next one, which does not follow from those before.
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
  std::vector<Camera> cameras_;
  MultiviewOptions options_;
  OutlineFinder outlines_;
  std::vector<double> rigidity_;  ///< [M]
  std::vector<double> shared_;     ///< [D] the rest pose with the shared DoFs in it
  PoseHistory history_;           ///< empty after a cut or a loss; begins with that pose
};

}  // namespace doppel
