#pragma once

#include <optional>
#include <vector>

#include "doppel/track/energy/outline.h"
#include "doppel/track/fit/track_config.h"
#include "doppel/track/fit/tracked_frame.h"
#include "doppel/track/footage.h"
#include "doppel/track/refine/surface_flow.h"
#include "doppel/track/refine/surface_offset.h"

namespace doppel {

/// Weights of the texture beside keypoints and outlines. Pixels are reference pixels (image 1024 wide).
struct RefineWeights {
  double matches = 0.16;  ///< of each match, per squared pixel
  double scale = 8.0;     ///< of the Geman-McClure kernel of matches, pixels
  int matches_per_camera = 600;
  int passes = 2;              ///< of drawing, flow and fit in each frame
  double flow_width = 1024.0;  ///< of FlowFinder, pixels
};

/// What the texture says about one frame.
struct FrameFlow {
  std::vector<Eigen::Vector3d> vertices;  ///< [N] world metres, as drawn
  std::vector<SurfaceFlow> views;         ///< [C]; empty where there is no image
  std::vector<SurfaceMatch> matches;      ///< of all cameras
  std::optional<double> distance;  ///< mean length of the flow by sureness, reference pixels; empty without matches
};

/// A pose and its inliers, by which it is tracked or lost.
TrackedFrame judge_pose(const PoseModel& model, const std::vector<PinholeCamera>& cameras, const FrameEvidence& seen,
                        std::vector<double> dofs, const PoseFitOptions& options);

/// Moves poses so that the drawn texture lies where the film shows it.
class FrameRefiner {
 public:
  /// @param character with texture @param landmarks [M] in the order of the keypoints @param cameras [C]; all must
  ///   outlive the refiner @throws Error for a character without a texture
  FrameRefiner(const Character& character, const std::vector<Marker>& landmarks,
               const std::vector<PinholeCamera>& cameras, const TrackConfig& config, const RefineWeights& weights);

  const PoseModel& model() const { return model_; }
  /// Draws the surface in all cameras and finds the flow to the film. @param seen with images
  FrameFlow flow(const FootageFrame& seen, const std::vector<double>& dofs);
  /// A pose as it is, before any fit.
  TrackedFrame judge(const FootageFrame& seen, const std::vector<double>& dofs) const;
  /// One fit to keypoints, outlines and matches.
  TrackedFrame fit(const FootageFrame& seen, const std::vector<SurfaceMatch>& matches,
                   const std::vector<double>& start) const;
  /// Adds what the frame says about the surface in the rest pose: its matches and its outlines.
  void add_to(SurfaceOffset& offset, const FootageFrame& seen, const std::vector<SurfaceMatch>& matches,
              const std::vector<double>& dofs) const;
  /// IoU of the skinned surface with the masks.
  double overlap(const FootageFrame& seen, const std::vector<double>& dofs) const;

 private:
  const std::vector<PinholeCamera>& cameras_;
  TrackConfig config_;
  RefineWeights weights_;
  PoseModel model_;
  OutlineFinder outlines_;
  SurfaceDrawer drawer_;
  FlowFinder finder_;
};

}  // namespace doppel
