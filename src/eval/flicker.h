#pragma once

#include <torch/types.h>

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>

#include "doppel/data/dataset/dataset.h"
#include "doppel/eval/image_metrics.h"
#include "doppel/eval/silhouette_overlap.h"

namespace doppel {

/// Two consecutive frames of a surface in one camera.
struct FramePair {
  torch::Tensor faces;       ///< int32 [F,3]
  torch::Tensor vertices;    ///< float32 [2,N,3] world, metres: the earlier frame, then the later one
  torch::Tensor projection;  ///< float32 [2,3,4] pixels from world metres, of each frame
  int size = 0;              ///< S, pixels of the square images
};

/// Where the points that the later frame shows lie in the earlier frame.
struct SurfaceFlow {
  cv::Mat map;      ///< CV_32FC2 [S,S] coordinates in the earlier image as of cv::remap, whose first pixel is at (0, 0)
  cv::Mat visible;  ///< CV_8UC1 [S,S] 255 where both frames see the point
};
/// A point is visible in the earlier frame if the four pixels around its projection show the surface in its depth, up
/// to 15 mm. @throws Error as Rasterizer
SurfaceFlow surface_flow(const FramePair& pair);

/// Sum of squared differences of colour between two frames, at the same points of the surface.
struct ColourChange {
  double sum = 0.0;         ///< over pixels and channels, colours 0..255
  std::int64_t pixels = 0;  ///< compared
  /// Root mean square over pixels and channels; 0 without pixels.
  double root_mean_square() const;
  ColourChange& operator+=(const ColourChange& other);
};
/// The sum over the pixels in `where` of |later(p) - earlier(flow(p))|^2, with bilinear interpolation of `earlier`.
/// @param earlier, later CV_8UC3 of the size of the flow @param where CV_8UC1, not 0: compared
ColourChange colour_change(const SurfaceFlow& flow, const cv::Mat& earlier, const cv::Mat& later, const cv::Mat& where);

/// How much the colours of the drawn and of the filmed surface change from frame to frame.
struct FlickerResult {
  ColourChange drawn, filmed;

  /// The root mean squares: `flicker` of the drawings, `filmed_flicker` of the images. Empty when nothing was compared.
  nlohmann::ordered_json to_json() const;
};

/// The flicker of drawings: the change of colour at points of the surface between consecutive frames, of the drawings
/// and of the filmed images along the same surface. The filmed images change by the noise of two images, the light, and
/// where the surface slides over the person; a drawing that changes less than they do does not flicker visibly.
/// Pixels count that lie, in both frames, at least two pixels inside both the drawing and the mask.
/// @param surface the surface that was drawn @param faces int32 [F,3]
/// Warns when nothing could be compared. @throws as evaluate_images
FlickerResult evaluate_flicker(const Dataset& dataset, Split split, const torch::Tensor& faces,
                               const SurfaceFunction& surface, const ImageFunction& render,
                               const EvaluationOptions& options, const std::string& title);

/// Whether two consecutive frames, of which the later one is evaluated, show the person in a compared camera. Without
/// them there is no flicker to measure.
bool has_flicker(const Dataset& dataset, Split split, const EvaluationOptions& options);

}  // namespace doppel
