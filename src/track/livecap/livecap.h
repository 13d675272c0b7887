#pragma once

/// The one-camera tracker (chapter 4): the pose and then the surface of each frame, from one camera.
///
/// The pose of a frame starts at the prediction of a filter of the motion. Six Gauss-Newton steps fit keypoints, 3D
/// joints (where a network predicts them), the outline (4.1-4.6), the prediction and the floor. The vertices are then
/// fitted to outline and colours, on top of the pose (4.7-4.15, `NonrigidStage`).

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "doppel/track/fit/pose_fit_options.h"
#include "doppel/track/fit/pose_history.h"
#include "doppel/track/fit/thesis_units.h"
#include "doppel/track/fit/tracked_frame.h"
#include "doppel/track/livecap/bone_lengths.h"
#include "doppel/track/livecap/landmark_roles.h"
#include "doppel/track/livecap/motion_filter.h"
#include "doppel/track/livecap/pose_prior.h"
#include "doppel/track/surface/nonrigid_stage.h"
#include "doppel/track/surface/surface_viewer.h"

namespace doppel {

/// Options of the one-camera tracker, in other units than those of the thesis (`thesis_units.h`). The temporal term
/// pulls landmarks to their positions in the last frame. The silhouette's weight is per outline vertex.
struct LivecapOptions : PoseFitOptions {
  /// Other defaults than the multi-view fit for the inherited options (livecap.cpp).
  LivecapOptions();

  /// Fit the pose with displacements that do not move the outline towards the camera or away from it. Not in the
  /// thesis.
  bool remove_depth = false;
  /// The mean distance between the outlines of template and mask is free (`LevelTerm`). Not in the thesis.
  bool level_silhouette = true;
  /// Subtract from the silhouette residual of a vertex its own distance to the outline of the drawn surface. false: the
  /// residual is I_DT(pi(V_i)) alone, as in 4.5.
  bool own_distance = true;
  bool ignore_confidence = false;           ///< keypoints of E_2D (4.3) count equally; false: by their confidence
  double min_confidence = kSeenConfidence;  ///< keypoints with a lower one do not count in E_2D
  /// lambda_3D, per squared metre, of joints with the error `kJointNoise`; inverse to the squared error of others.
  /// 0: no 3D joints
  double joint_weight = per_squared_millimetre(3.0);
  MotionOptions motion;
  /// [F][D] Poses that the person usually takes, for example those of the studio; empty: none are known. Their mean
  /// replaces the rest pose, in DoFs that are not unknown too.
  std::vector<std::vector<double>> usual_poses;
  double usual_weight = 1000.0;  ///< of the squared Mahalanobis distance from them
  double usual_spread = 0.1;     ///< standard deviation added to them, radians
  double floor_weight =
      per_squared_millimetre(5.0);  ///< per squared metre, of the height of standing feet above the floor y = 0
  double floor_slide = 0.2;         ///< weight of their sliding, relative to that of their height
  double floor_scale = 0.02;        ///< of the robust kernel, metres
  bool faces = true;                ///< landmarks of the face have weight 0.326; false: weight 0
  int start_iterations = 60;        ///< of a frame without a prediction

  bool surface = true;  ///< run the second stage; false: the surface is the skinned template
  NonrigidOptions nonrigid;
};

/// The evidence of one frame.
struct LivecapInput {
  ViewEvidence view;
  std::vector<JointDetection> joints;  ///< [M] from any origin; may be empty
  cv::Mat image;                       ///< 8-bit BGR, without distortion; may be empty
};

class LivecapTracker {
 public:
  /// @param landmarks in the order of the keypoints @param dofs to find; the others keep the values of the rest pose
  /// @param character must outlive the tracker
  /// @throws Error for fewer than four landmarks, a root that cannot rotate freely, or options out of range
  LivecapTracker(const Character& character, const std::vector<Marker>& landmarks, const std::vector<int>& dofs,
                 const PinholeCamera& camera, const LivecapOptions& options = {});

  FrameResult track(const LivecapInput& input);
  /// The next frame begins a new segment.
  void cut();
  /// Frames are missing before the next one. The person is the same: the next state is `recovered`, not `initialised`.
  void pause();

  const PoseModel& model() const { return model_; }

 private:
  struct Evidence;
  struct Fit;
  std::vector<std::unique_ptr<PoseTerm>> terms(const Evidence& evidence, const std::vector<double>* expected,
                                               double keypoint_weight) const;
  std::vector<double> predicted_pose() const;
  std::unique_ptr<PoseTerm> floor_term(bool follows) const;
  void set_depth_aside(const PosedSurface& surface, const std::vector<OutlineVertex>& outline);
  std::unique_ptr<PoseTerm> silhouette_term(const Evidence& evidence, const std::vector<double>& dofs);
  Fit fit(const Evidence& evidence, std::vector<double> start, const std::vector<double>* expected);
  Fit start_anew(const Evidence& evidence);
  Fit track_pose(const Evidence& evidence);
  void remember(const Fit& found);
  void forget_surface();
  void deform_template(std::vector<Eigen::Vector3d> rest_vertices);
  void track_surface(const LivecapInput& input, FrameResult& frame);

  PoseModel model_;
  std::vector<PinholeCamera> cameras_;  ///< [1]
  LivecapOptions options_;
  SurfaceViewer viewer_;
  LandmarkRoles roles_;
  LandmarkTree tree_;
  std::vector<double> rigidity_;     ///< [M]
  std::vector<double> sole_height_;  ///< [M] above the floor in the rest pose, metres
  std::optional<PosePrior> usual_;
  std::vector<double> usual_pose_;  ///< [D] the mean of the usual poses, or the rest pose
  PoseHistory history_;
  MotionFilter motion_;                         ///< empty without a history, or if it is switched off
  std::vector<Eigen::Vector3d> rest_vertices_;  ///< [N] the template with the displacements of the last frame
  NonrigidStage surface_;
};

}  // namespace doppel
