#pragma once

#include <opencv2/video/tracking.hpp>
#include <vector>

#include "doppel/track/energy/terms/match_term.h"
#include "doppel/track/refine/drawn_surface.h"

namespace doppel {

/// The optical flow from a drawn surface to the film of the same camera.
struct SurfaceFlow {
  cv::Rect box;  ///< of the camera's image, as of the DrawnSurface
  cv::Mat flow;  ///< float32 x 2, pixels: what is drawn at x is filmed at x + flow(x)
  cv::Mat sure;  ///< 8-bit, 255 where the flow can be trusted, else 0: the surface is drawn there, the film shows the
                 ///< person, and the flow back leads to the start or the colours agree
  cv::Mat structure;  ///< float32 x 3: mean products xx, xy, yy of the drawing's gradients around a pixel, grey levels
                      ///< squared

  bool empty() const { return box.empty(); }
};

/// Finds the flow (DIS, of OpenCV) between the grey drawing and the grey film, both over the same backdrop where the
/// person is not.
class FlowFinder {
 public:
  /// @param finest_width width of a camera's image, pixels, to which the flow is refined; larger images are halved
  explicit FlowFinder(double finest_width = 1024.0);
  /// @param image 8-bit BGR of the camera's size @param mask 0 or 255, of the same size, or empty: the whole image
  SurfaceFlow find(const DrawnSurface& drawn, const cv::Mat& image, const cv::Mat& mask);

 private:
  double finest_width_;
  cv::Ptr<cv::DISOpticalFlow> flow_;
};

/// The film moved to where the surface is drawn, for a texture without the errors of pose and surface.
struct AlignedFilm {
  cv::Mat image;  ///< 8-bit BGR, of the camera's size
  cv::Mat mask;   ///< 255 where the flow is sure, else 0
};
AlignedFilm align_film(const SurfaceFlow& flow, const cv::Mat& image);

/// The matches of visible vertices, at most `most`, evenly thinned out.
/// @param vertices [N] world metres, as drawn @param camera its index is `number` in the matches
std::vector<SurfaceMatch> surface_matches(const SurfaceFlow& flow, const DrawnSurface& drawn,
                                          const std::vector<Eigen::Vector3d>& vertices, const PinholeCamera& camera,
                                          int number, int most);

}  // namespace doppel
