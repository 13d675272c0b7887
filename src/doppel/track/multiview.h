#pragma once

/// The multi-view fit (5.8, MVBL): the pose of each frame from the keypoints and masks of all cameras.
///
/// A frame starts where the last ones lead to. First the keypoints are fitted, then keypoints and outlines together.
/// The first frame of a segment, and one whose fit was lost, starts from landmarks placed in the world by triangulation
/// instead, so no pose need be given.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "doppel/track/evidence.h"
#include "doppel/track/fit_problem.h"
#include "doppel/track/outline.h"
#include "doppel/track/pose_history.h"
#include "doppel/track/pose_model.h"
#include "doppel/track/triangulation.h"

namespace doppel {

struct MultiviewOptions {
  /// A term of weight 0 is switched off. Weights are per squared reference pixel, metre or radian.
  double keypoint_weight = 1.0;
  double keypoint_scale = 20.0;    ///< of the Geman-McClure kernel, reference pixels
  double silhouette_weight = 5.0;  ///< of each camera
  double silhouette_inside = 1.0;  ///< share of it that an outline within the mask counts
  double silhouette_scale = 20.0;  ///< of the Geman-McClure kernel, reference pixels
  double contour_weight = 0.0;     ///< of each camera: the mask's outline to the surface's, kernel as above
  double contour_reach = 60.0;     ///< reference pixels: farther apart they do not belong together
  double limit_weight = 2000.0;
  double temporal_weight = 5000.0;  ///< landmarks to where the last frames lead
  double steady_weight = 100.0;     ///< DoFs to where the last frames lead
  double prior_weight = 3.0;        ///< DoFs to the rest pose

  int outline_pixels = 256;    ///< side of the windows that outlines are looked for in
  int outline_vertices = 200;  ///< of a camera, at most
  int outline_rounds = 2;      ///< how often the outline of the model is found anew in a frame
  SolverOptions solver;        ///< of each fit

  double agreement = 40.0;          ///< a keypoint agrees within so many reference pixels
  double smallest_share = 0.5;      ///< of keypoints that agree: below, the fit is lost
  int fewest_keypoints = 8;         ///< confident ones in a frame: below, there is nothing to fit
  double farthest_landmark = 0.15;  ///< metres from its triangulated point: beyond, a new start is tried as well
};

enum class FrameState {
  tracked,      ///< followed from the frame before
  initialised,  ///< the first of a segment
  recovered,    ///< started anew, and found
  lost,         ///< not to be trusted: the pose is only a guess
};
std::string to_string(FrameState state);

struct TrackedFrame {
  std::vector<double> dofs;  ///< [D]
  FrameState state = FrameState::lost;
  int keypoints = 0;                                ///< that the detectors were confident of
  double agreeing = 0.0;                            ///< share of them that agree with the pose
  double keypoint_error = 0.0;                      ///< mean distance of those that agree, reference pixels
  int iterations = 0;                               ///< Gauss-Newton steps of all fits of this frame
  std::vector<TermCost> terms;                      ///< at the end
  SolverStop reason = SolverStop::iteration_limit;  ///< of the last fit

  bool trusted() const { return state != FrameState::lost; }
};

class MultiviewTracker {
 public:
  /// @param landmarks in the order of the keypoints; @param dofs to be found, the others keep the rest pose's values
  /// @param cameras without distortion
  /// @throws UsageError for fewer than two cameras; Error for fewer than four landmarks, options out of range
  MultiviewTracker(const Character& character, const std::vector<Marker>& landmarks, const std::vector<int>& dofs,
                   std::vector<Camera> cameras, const MultiviewOptions& options = {});

  /// The next frame. @param frame [C], keypoints [M] each
  TrackedFrame track(const FrameEvidence& frame);
  /// The next frame does not follow from those before.
  void cut();

  const PoseModel& model() const { return model_; }

 private:
  struct Fit;
  using Points = std::vector<std::optional<TriangulatedPoint>>;
  std::optional<std::vector<double>> start_anew(const Points& points) const;
  Fit fit(const FrameEvidence& frame, std::vector<double> start, const std::vector<double>* expected) const;
  std::vector<std::unique_ptr<PoseTerm>> terms(const FrameEvidence& frame, const std::vector<double>* expected) const;
  void judge(const FrameEvidence& frame, TrackedFrame& found) const;
  bool strays(const TrackedFrame& found, const Points& points) const;
  void remember(const TrackedFrame& found);

  PoseModel model_;
  std::vector<Camera> cameras_;
  MultiviewOptions options_;
  OutlineFinder outlines_;
  std::vector<double> rigidity_;  ///< [M]
  PoseHistory history_;           ///< empty after a cut or a loss; begins with the rest pose
  bool segment_begins_ = true;
};

}  // namespace doppel
