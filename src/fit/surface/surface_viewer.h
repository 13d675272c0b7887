#pragma once

#include <memory>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/camera.h"
#include "doppel/fit/surface/part_mask.h"
#include "doppel/fit/surface/posed_surface.h"
#include "doppel/energy/terms/silhouette_term.h"

namespace doppel {

/// What a camera sees of a surface.
struct SurfaceView {
  /// Vertices on the outline, ascending: an uncovered pixel is among the 3x3 around them.
  std::vector<OutlineVertex> outline;
  std::vector<char> visible;  ///< [N] 1: faces the camera, and nothing is in front of it
  PartMask parts;
};

class SurfaceViewer {
 public:
  /// @param camera without distortion; @param pixels side of the windows that the surface is drawn in
  SurfaceViewer(const Character& character, const Camera& camera, int pixels);
  ~SurfaceViewer();
  SurfaceViewer(SurfaceViewer&&) noexcept;
  SurfaceViewer& operator=(SurfaceViewer&&) noexcept;

  const std::vector<char>& vertex_parts() const;  ///< [N] `body_parts`
  /// @param window of the image; what lies outside of it is neither visible nor on the outline
  /// @param growth of the parts, pixels of the image
  SurfaceView look(const PosedSurface& surface, const CropBox& window, double growth);
  /// Intersection over union of what a surface covers with a mask, in the pixels of the image.
  /// @param vertices [3,N] world metres @param mask 0 or 255, of the camera's size
  double overlap(const Eigen::Matrix3Xd& vertices, const cv::Mat& mask);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel
