#pragma once

/// The surface of each frame (5.8, MVBL): the pose stays, and the nodes of the embedded graph bend the surface until
/// its outline is that of the masks of all cameras, both ways.

#include <optional>
#include <vector>

#include "doppel/energy/evidence.h"
#include "doppel/energy/fit_problem.h"
#include "doppel/energy/graph_model.h"
#include "doppel/energy/outline.h"

namespace doppel {

struct SurfaceOptions {
  /// A term of weight 0 is switched off. Weights are per squared reference pixel or metre.
  double keypoint_weight = 0.05;
  double keypoint_scale = 20.0;    ///< of the Geman-McClure kernel, reference pixels
  double silhouette_weight = 1.0;  ///< of each camera: the surface's outline to the mask's
  double contour_weight = 1.0;     ///< of each camera: the mask's outline to the surface's
  double contour_reach = 60.0;     ///< reference pixels: farther apart they do not belong together
  double silhouette_scale = 30.0;  ///< of the kernel of both
  double arap_weight = 3.0e4;
  double temporal_weight = 1.0e5;  ///< nodes to where they were
  double rest_weight = 1.0e4;      ///< nodes to no deformation

  int outline_pixels = 256;    ///< side of the windows that outlines are looked for in
  int outline_vertices = 400;  ///< and points of the mask's, of a camera, at most
  int rounds = 2;              ///< how often outlines are found anew in a frame
  SolverOptions solver{4};     ///< of each round
};

struct SurfaceFrame {
  std::vector<double> parameters;  ///< [6K] A_k, T_k of each node
  double posed_overlap = 0.0;      ///< IoU with the masks, mean over cameras, of the pose alone
  double overlap = 0.0;            ///< and of the bent surface
  int iterations = 0;
  std::vector<TermCost> terms;  ///< at the end
  ConvergenceReason reason = ConvergenceReason::iteration_limit;
};

class SurfaceTracker {
 public:
  /// @param cameras without distortion @throws Error when the character has no graph, or for options out of range
  SurfaceTracker(const Character& character, const std::vector<Marker>& landmarks, std::vector<Camera> cameras,
                 const SurfaceOptions& options = {});

  /// The next frame, from where the last one ended. @param dofs [D] its pose
  SurfaceFrame track(const FrameEvidence& frame, const std::vector<double>& dofs);
  /// The next frame does not follow from those before.
  void cut() { last_.reset(); }

  /// In the pose of the last frame.
  const GraphModel& model() const { return model_; }

 private:
  FitProblem<GraphModel>::Terms terms(const FrameEvidence& frame, const std::vector<OutlineVertex>& outline) const;

  GraphModel model_;
  std::vector<Camera> cameras_;
  SurfaceOptions options_;
  OutlineFinder outlines_;
  std::optional<std::vector<double>> last_;  ///< [6K]
};

}  // namespace doppel
