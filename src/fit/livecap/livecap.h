#pragma once

/// The one-camera tracker (chapter 4): pose, and then surface, from what one camera sees, frame by frame.
///
/// A frame's pose starts where the last two lead to. Six Gauss-Newton steps fit keypoints, joints in space where a
/// network gave some, and the outline (4.1-4.6). The surface then leaves the skeleton and follows outline and colours
/// (4.7-4.15, `NonrigidStage`).

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "doppel/fit/livecap/bone_lengths.h"
#include "doppel/fit/livecap/landmark_roles.h"
#include "doppel/fit/pose_fit_options.h"
#include "doppel/fit/pose_history.h"
#include "doppel/fit/surface/nonrigid_stage.h"
#include "doppel/fit/surface/surface_viewer.h"
#include "doppel/fit/tracked_frame.h"

namespace doppel {

/// Weights are those of the thesis (4.8), in its units: millimetres, pixels of an image 540 wide, radians. A term of
/// weight 0 is switched off. Landmarks are held where they were in the last frame, and outlines weigh by the vertex.
struct LivecapOptions : PoseFitOptions {
  LivecapOptions();

  double joint_weight = 28.0;  ///< lambda_3D
  bool faces = true;           ///< points of the face count 0.326; false: not at all
  int start_iterations = 60;   ///< of a frame that starts from nothing

  bool surface = true;  ///< the second stage; false: the skinned template
  NonrigidOptions nonrigid;
};

/// What was seen of one instant.
struct LivecapInput {
  ViewEvidence view;
  std::vector<std::optional<Eigen::Vector3d>> joints;  ///< [M] camera axes, from any origin, metres; or none
  cv::Mat image;                                     ///< 8-bit BGR, without distortion; may be empty
};

class LivecapTracker {
 public:
  /// @param landmarks in the order of the keypoints; @param dofs to be found, the others keep the rest pose's values
  /// @param camera without distortion @param character must outlive the tracker
  /// @throws Error for fewer than four landmarks, a root that cannot be turned freely, or options out of range
  LivecapTracker(const Character& character, const std::vector<Marker>& landmarks, const std::vector<int>& dofs,
                 const Camera& camera, const LivecapOptions& options = {});

  FrameResult track(const LivecapInput& input);
  /// The next frame does not follow from those before.
  void cut();
  /// Frames are missing before the next one. The person is the same and is `recovered` rather than `initialised`.
  void pause();

  const PoseModel& model() const { return model_; }

 private:
  struct Evidence;
  struct Fit;
  std::vector<std::unique_ptr<PoseTerm>> terms(const Evidence& evidence, const std::vector<double>* expected,
                                               double keypoint_weight) const;
  void set_depth_aside(const PosedSurface& surface, const std::vector<OutlineVertex>& outline);
  std::unique_ptr<PoseTerm> silhouette_term(const Evidence& evidence, const std::vector<double>& dofs);
  Fit fit(const Evidence& evidence, std::vector<double> start, const std::vector<double>* expected);
  Fit start_anew(const Evidence& evidence);
  TrackedFrame track_pose(const Evidence& evidence);
  void remember(const TrackedFrame& found);
  void forget_surface();
  void bend(std::vector<Eigen::Vector3d> rest_vertices);
  void track_surface(const LivecapInput& input, FrameResult& frame);

  PoseModel model_;
  std::vector<Camera> cameras_;  ///< the one
  LivecapOptions options_;
  SurfaceViewer viewer_;
  LandmarkRoles roles_;
  LandmarkTree tree_;
  std::vector<double> rigidity_;  ///< [M]
  PoseHistory history_;
  std::vector<Eigen::Vector3d> rest_vertices_;  ///< [N] the template, bent as the last frame's surface was
  NonrigidStage surface_;
};

}  // namespace doppel
