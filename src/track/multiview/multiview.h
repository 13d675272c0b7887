#pragma once

/// The multi-view fit (5.8, MVBL): the pose of each frame from the keypoints and masks of all cameras.
///
/// The fit of a frame starts at the pose that is predicted from the last two frames. It fits the keypoints first, then
/// keypoints and outlines together. If the result has too few inliers, the frame is fitted again from triangulated
/// landmarks. A frame without a prediction is fitted from triangulated landmarks too: the first frame of a segment, and
/// the frame after a pause or a lost frame. No initial pose is needed.
///
/// Letters: C cameras, M landmarks, D DoFs. Reference pixels are pixels of an image 1024 wide.

#include <memory>
#include <optional>
#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/fit_problem.h"
#include "doppel/track/energy/outline.h"
#include "doppel/track/energy/pose_model.h"
#include "doppel/track/energy/triangulation.h"
#include "doppel/track/fit/pose_fit_options.h"
#include "doppel/track/fit/pose_history.h"
#include "doppel/track/fit/tracked_frame.h"

namespace doppel {

/// DoFs of parts without landmarks, for example wrists and fingers, with values that replace those of the rest pose.
/// The outlines of a single frame hardly determine such a DoF. All frames together determine it well, when its value is
/// the same in each.
struct SharedDofs {
  std::vector<int> dofs;       ///< indices
  std::vector<double> values;  ///< [dofs]
  double weight = 100.0;       ///< of the prior on those that a fit has as unknowns, per squared radian

  /// Replaces these DoFs of a pose. @param pose [D]
  void put_into(std::vector<double>& pose) const;
};

/// Options of the multi-view fit. Pixels are reference pixels, as in `PoseFitOptions`. The weights of silhouette and
/// contour hold for each camera: its outline vertices or contour points share them equally. The temporal term pulls
/// landmarks to their positions in the predicted pose.
struct MultiviewOptions : PoseFitOptions {
  double silhouette_inside = 1.0;  ///< factor of the silhouette's weight for outline vertices inside the mask
  double contour_weight = 0.0;  ///< per squared reference pixel; uses the kernel of the silhouette; 0: no contour term
  double contour_reach = 60.0;  ///< largest distance between a contour point and its outline vertex, reference pixels
  int outline_rounds = 2;  ///< fits with outlines per start; each finds the outline vertices anew. 0: keypoints only
  /// Largest distance of a landmark from its triangulated position, metres. When a landmark that was triangulated from
  /// three or more views is farther off, the fit is also started from the triangulated landmarks.
  double max_landmark_distance = 0.15;
  SharedDofs shared_dofs;
};

/// The image terms of a frame: keypoints; with outline vertices also the silhouette, and the contour if its weight is
/// not 0. For a `PoseModel` or a `ShapeModel`.
/// @param cameras, frame [C]; both must outlive the terms
/// @param outline the outline vertices of all cameras (OutlineFinder); empty: only the keypoint term is made
template <typename Model>
typename FitProblem<Model>::Terms image_terms(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
                                              const std::vector<OutlineVertex>& outline,
                                              const MultiviewOptions& options);

/// Tracks a person frame by frame with the multi-view fit.
class MultiviewTracker {
 public:
  /// @param character must outlive the tracker
  /// @param landmarks [M] in the order of the keypoints
  /// @param dofs indices of the DoFs to find, each once. The others keep their values: those of options.shared_dofs, or
  /// else of the rest pose.
  /// @param cameras [C]
  /// @throws UsageError for fewer than two cameras; Error for fewer than four landmarks or options out of range
  MultiviewTracker(const Character& character, const std::vector<Marker>& landmarks, const std::vector<int>& dofs,
                   std::vector<PinholeCamera> cameras, const MultiviewOptions& options = {});

  /// Tracks the next frame.
  /// @param frame [C], each with keypoints [M]; a view with an empty outline gives keypoints only
  /// @return the pose with its inliers. State `lost`: nothing fits well enough, and the pose is a guess. A frame with
  /// fewer than min_keypoints confident keypoints is not fitted; its pose is the last one that was found.
  TrackedFrame track(const FrameEvidence& frame);
  /// Announces that the next frame begins a new segment. Its pose is not predicted. The next frame that is found has
  /// the state `initialised`.
  void cut() { history_.cut(); }
  /// Announces that frames are missing before the next one. Its pose is not predicted. The next frame that is found has
  /// the state `recovered`, or `initialised` if no frame of the segment was found before.
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
  PoseHistory history_;           ///< empty after a cut, a pause or a lost frame; `last()` is at first `shared_`
};

}  // namespace doppel
