#pragma once

/// The surface of each frame (5.8, MVBL). The pose is fixed. The nodes of the embedded graph deform the surface such
/// that its outline and the outline of the mask coincide in all cameras.

#include <optional>
#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/fit_problem.h"
#include "doppel/track/energy/graph_model.h"
#include "doppel/track/energy/outline.h"

namespace doppel {

struct SurfaceOptions {
  /// A weight of 0 switches a term off.
  double keypoint_weight = 0.05;   ///< per squared reference pixel
  double keypoint_scale = 20.0;    ///< of the Geman-McClure kernel, reference pixels; 0: no kernel
  double silhouette_weight = 1.0;  ///< per squared reference pixel, each camera: surface's outline to the mask's
  double contour_weight = 1.0;     ///< per squared reference pixel, each camera: mask's outline to the surface's
  double contour_reach = 60.0;     ///< reference pixels: largest distance of a contour point and its vertex
  double silhouette_scale = 30.0;  ///< of the Geman-McClure kernel of silhouette and contour, reference pixels
  double arap_weight = 3.0e4;      ///< per squared metre
  double temporal_weight = 1.0e5;  ///< per squared metre: nodes to their parameters in the last frame
  double rest_weight = 1.0e4;      ///< per squared metre: nodes to no deformation

  int outline_vertices = 400;  ///< largest number of outline vertices, and of contour points, per camera
  int rounds = 2;              ///< how often outlines are found again in a frame
  SolverOptions solver{4};     ///< of each round
};

struct SurfaceFrame {
  std::vector<double> parameters;  ///< [6K] A_k, T_k of each node
  double posed_overlap = 0.0;      ///< IoU of the skinned surface with the masks, mean over cameras
  double overlap = 0.0;            ///< the same of the deformed surface
  int iterations = 0;
  std::vector<TermCost> terms;  ///< at the end
  ConvergenceReason reason = ConvergenceReason::iteration_limit;
};

class SurfaceTracker {
 public:
  /// @throws Error when the character has no graph, or for options out of range
  SurfaceTracker(const Character& character, const std::vector<Marker>& landmarks, std::vector<PinholeCamera> cameras,
                 const SurfaceOptions& options = {});

  /// Fits the next frame, starting from the parameters of the last one. @param dofs [D] its pose
  SurfaceFrame track(const FrameEvidence& frame, const std::vector<double>& dofs);
  /// A new segment begins: the next frame starts undeformed.
  void cut() { last_.reset(); }

  /// The model, in the pose of the last frame.
  const GraphModel& model() const { return model_; }

 private:
  FitProblem<GraphModel>::Terms terms(const FrameEvidence& frame, const std::vector<OutlineVertex>& outline) const;

  GraphModel model_;
  std::vector<PinholeCamera> cameras_;
  SurfaceOptions options_;
  OutlineFinder outlines_;
  std::optional<std::vector<double>> last_;  ///< [6K]
};

}  // namespace doppel
