#pragma once

#include <memory>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/camera.h"
#include "doppel/track/energy/terms/silhouette_term.h"
#include "doppel/track/surface/part_mask.h"
#include "doppel/track/surface/posed_surface.h"

namespace doppel {

/// A surface as one camera sees it.
struct SurfaceView {
  /// Vertices on the outline, ascending: the surface leaves one of the 3x3 pixels around them uncovered.
  std::vector<OutlineVertex> outline;
  std::vector<char> visible;  ///< [N] 1 for vertices that face the camera and are not occluded
  PartMask parts;
};

class SurfaceViewer {
 public:
  /// @param pixels side of the windows in which the surface is drawn
  SurfaceViewer(const Character& character, const PinholeCamera& camera, int pixels);
  ~SurfaceViewer();
  SurfaceViewer(const SurfaceViewer&) = delete;
  SurfaceViewer& operator=(const SurfaceViewer&) = delete;

  const std::vector<char>& vertex_parts() const;  ///< [N] `body_parts`
  /// @param window of the image; vertices outside of it are neither visible nor on the outline
  /// @param growth of the parts, pixels of the image
  SurfaceView look(const PosedSurface& surface, const CropBox& window, double growth);
  /// Intersection over union of the surface's silhouette and a mask, in the pixels of the image.
  /// @param vertices [3,N] world metres @param mask 0 or 255, of the camera's size
  double overlap(const Eigen::Matrix3Xd& vertices, const cv::Mat& mask);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel
