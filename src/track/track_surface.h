#pragma once

#include <filesystem>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/core/progress.h"
#include "doppel/track/footage.h"
#include "doppel/track/surface/surface_tracker.h"

namespace doppel {

/// The surface of a tracked sequence.
struct TrackedSurface {
  std::vector<SurfaceFrame> frames;  ///< without their parameters, which are in the file
  double seconds = 0.0;              ///< time of fitting, without reading
};

/// Deforms the surface in every frame of a motion, each frame starting from the result of the last one.
/// @param stem of the files: `<stem>_graph.npy` float32 [frames, K, 6] (A, T of 6.2) and, with `vertices`,
///   `<stem>_vertices.npy` float32 [frames, N, 3], world metres
TrackedSurface track_surface(const Footage& footage, const FootageSequence& sequence, const Motion& motion,
                             const SurfaceOptions& options, const std::filesystem::path& stem, bool vertices,
                             Progress& progress);

/// Fits the template to the clothes as worn in the capture: it deforms the surface to the masks in some frames and
/// takes the mean in the rest pose. Clothes hang differently in motion than in the scan. Poses that are fitted to
/// outlines with this template are not biased by the difference.
class TemplateFit {
 public:
  /// @param character must outlive the fit @param landmarks, cameras as for SurfaceTracker
  TemplateFit(const Character& character, const std::vector<Marker>& landmarks,
              const std::vector<PinholeCamera>& cameras, const SurfaceOptions& options);
  /// @param dofs [D] the pose in this frame @return how well the surface overlaps with the masks
  double add(const FrameEvidence& seen, const std::vector<double>& dofs);
  /// The character with this template. @throws Error before any frame
  Character character() const;

 private:
  const Character& character_;
  SurfaceTracker tracker_;
  std::vector<Eigen::Vector3d> sum_;  ///< [N]
  int count_ = 0;
};

}  // namespace doppel
