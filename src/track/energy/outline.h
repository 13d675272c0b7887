#pragma once

#include <memory>
#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/pose_model.h"
#include "doppel/track/energy/terms/silhouette_term.h"

namespace doppel {

/// Finds the vertices on the outline of a surface in every camera, and how far inside of the drawn outline they lie.
/// The surface is drawn in the window of each camera's outline field.
class OutlineFinder {
 public:
  /// @param most vertices of one camera; more are thinned out evenly
  OutlineFinder(const Character& character, std::vector<PinholeCamera> cameras, int most);
  ~OutlineFinder();
  OutlineFinder(const OutlineFinder&) = delete;
  OutlineFinder& operator=(const OutlineFinder&) = delete;

  /// @param vertices [N] world metres
  std::vector<OutlineVertex> find(const FrameEvidence& frame, const std::vector<Eigen::Vector3d>& vertices) const;
  /// Intersection over union of the drawn surface and the mask in the windows, mean over the cameras that see the
  /// person; 0 when none does.
  double overlap(const FrameEvidence& frame, const std::vector<Eigen::Vector3d>& vertices) const;

 private:
  struct State;
  std::unique_ptr<const State> state_;
};

/// The posed surface, [N] world metres.
std::vector<Eigen::Vector3d> posed_vertices(const PoseModel& model, const PosedBody& body);

}  // namespace doppel
