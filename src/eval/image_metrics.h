#pragma once

#include <torch/types.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/data/dataset.h"
#include "doppel/eval/silhouette_overlap.h"

namespace doppel {

/// How two images differ, colours counted 0..255.
struct ImageScores {
  double MSE = 0.0;   ///< mean over all pixels and channels
  double PSNR = 0.0;  ///< 10 log10(255^2 / MSE), dB; at most kHighestPsnr, which equal images get
  double SSIM = 0.0;  ///< see structural_similarity

  nlohmann::ordered_json to_json() const;
};
inline constexpr double kHighestPsnr = 100.0;

/// SSIM after Wang et al. 2004: Gaussian window of 11 x 11 pixels and standard deviation 1.5, C1 = (0.01 * 255)^2,
/// C2 = (0.03 * 255)^2, variances of the whole window (not of a sample); mean over the windows that lie in the image,
/// then over channels.
/// @param a, b 8-bit images of one size with three channels
/// @throws UsageError when they are smaller than the window, or differ in size or type
double structural_similarity(const cv::Mat& a, const cv::Mat& b);

/// All three. @throws as structural_similarity
ImageScores compare_images(const cv::Mat& a, const cv::Mat& b);

/// What a renderer is asked for: B frames in one camera, in pixels of the prepared crops.
struct ImageRequest {
  std::vector<SampleId> samples;  ///< [B]
  int camera = 0;                 ///< index in Dataset::cameras()
  torch::Tensor projection;       ///< float32 [B,1,3,4] crop pixels from world metres
  int size = 0;                   ///< S
  std::vector<int> sides = {};    ///< [B] of the same crops in pixels of the camera

  /// Of crop b, in pixels of the camera. @return float32 [1,1,3,4]
  torch::Tensor filmed_projection(std::size_t b) const;
};
/// What it gives back.
struct RenderedImages {
  torch::Tensor colour;   ///< float32 [B,S,S,3] or [B,1,S,S,3], RGB 0..1
  torch::Tensor covered;  ///< bool or uint8 of the same shape without colours
  /// Draws frame b as the camera would film it, where the renderer can tell: float32 [n,n,4], n = sides[b], colours
  /// times the covered part of the pixel, and that part. Asked for after `colour`, and not counted in its time.
  std::function<torch::Tensor(std::size_t b)> filmed = nullptr;
};
using ImageFunction = std::function<RenderedImages(const ImageRequest&)>;

/// Of one camera, or their mean.
struct PhotometricScores {
  ImageScores masked;  ///< both images black outside the true mask
  ImageScores full;    ///< the drawing over its background, against the image as filmed
  /// The drawing as filmed, over its background, resized as the image was; both black outside the true mask.
  std::optional<ImageScores> filmed;
  double missing_MSE = 0.0;  ///< part of masked.MSE that comes from pixels of the mask where nothing is drawn
  double foreground = 0.0;   ///< share of the true mask in the crop: masked.MSE / foreground is the MSE of the person
};

struct PhotometricResult {
  std::vector<std::pair<std::string, PhotometricScores>> cameras;  ///< mean over the camera's frames
  PhotometricScores mean;                                          ///< over cameras
  double seconds = 0.0;                                            ///< to draw one image, mean

  nlohmann::ordered_json to_json() const;
};

/// Draws every frame of a split into every camera and compares with the prepared crops (see photometric_protocol).
/// Frames in which a camera sees nobody do not count. Drawings are rounded to 8 bits first, as a file would hold them.
/// @throws UsageError for an unknown camera, or a drawing of another shape; Error when no camera sees anybody
PhotometricResult evaluate_images(const Dataset& dataset, Split split, const ImageFunction& render,
                                  const EvaluationOptions& options, const std::string& title);

/// The conditions, to be printed with the figures.
nlohmann::ordered_json photometric_protocol(const Dataset& dataset);

}  // namespace doppel
