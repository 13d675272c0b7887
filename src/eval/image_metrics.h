#pragma once

#include <torch/types.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/data/dataset/dataset.h"
#include "doppel/eval/silhouette_overlap.h"

namespace doppel {

/// Differences between two images, colours 0..255.
struct ImageScores {
  double MSE = 0.0;   ///< mean over all pixels and channels
  double PSNR = 0.0;  ///< 10 log10(255^2 / MSE), dB; at most kMaxPsnr, the value for equal images
  double SSIM = 0.0;  ///< see structural_similarity

  nlohmann::ordered_json to_json() const;
};
inline constexpr double kMaxPsnr = 100.0;

/// SSIM after Wang et al. 2004: Gaussian window of 11 x 11 pixels and standard deviation 1.5, C1 = (0.01 * 255)^2, C2 =
/// (0.03 * 255)^2, population variances of the window (not sample variances); mean over the windows that lie in the
/// image, then over channels.
/// @param a, b 8-bit images of one size with three channels
/// @throws UsageError when the images are smaller than the window, or differ in size or type
double structural_similarity(const cv::Mat& a, const cv::Mat& b);

/// Colours 0..1 as bytes, rounded as in a file. @return uint8 of the same shape, contiguous
torch::Tensor eight_bit_colours(const torch::Tensor& colour);

/// MSE, PSNR and SSIM of two images. @throws as structural_similarity
ImageScores compare_images(const cv::Mat& a, const cv::Mat& b);

/// The input of a renderer: B frames in one camera, in pixels of the prepared crops.
struct ImageRequest {
  std::vector<SampleId> samples;  ///< [B]
  int camera = 0;                 ///< index in Dataset::cameras()
  torch::Tensor projection;       ///< float32 [B,1,3,4] crop pixels from world metres
  int size = 0;                   ///< S
  std::vector<int> sides = {};    ///< [B] of the same crops in pixels of the camera

  /// The projection of crop b at the camera's resolution. @return float32 [1,1,3,4]
  torch::Tensor filmed_projection(std::size_t b) const;
};
/// A drawing of the whole image of a camera, H x W pixels.
struct WholeDrawing {
  torch::Tensor colour;   ///< float32 [H,W,3], RGB 0..1
  torch::Tensor covered;  ///< bool or uint8 [H,W]
  torch::Tensor alpha{};  ///< float32 [H,W] 0..1, then `colour` is over black; undefined: 1 where covered
};
/// The output of a renderer.
struct RenderedImages {
  torch::Tensor colour;   ///< float32 [B,S,S,3] or [B,1,S,S,3], RGB 0..1
  torch::Tensor covered;  ///< bool or uint8 of the same shape without the channels
  /// Draws frame b at the camera's resolution as the camera would film it; empty if the renderer cannot do this.
  /// Returns float32 [n,n,4], n = sides[b]: colours times the covered share of the pixel, and this share. Called after
  /// `colour` is drawn, outside the measured time.
  std::function<torch::Tensor(std::size_t b)> filmed = nullptr;
  /// Draws frame b in the whole image of the camera, at the camera's resolution; empty if the renderer cannot do this.
  /// Called only for EvaluationOptions::whole_frames, outside the measured time.
  std::function<WholeDrawing(std::size_t b)> whole = nullptr;
  /// float32 0..1 of the shape of `covered`, for a drawing that covers parts of pixels. `colour` is then over black and
  /// counts everywhere; `covered` only says where something is missing. Undefined: 1 where covered.
  torch::Tensor alpha{};
};
using ImageFunction = std::function<RenderedImages(const ImageRequest&)>;

/// The scores of one camera, or the mean over cameras.
struct PhotometricScores {
  ImageScores masked;  ///< both images black outside the mask of the capture
  ImageScores full;    ///< the drawing over its background, against the image as filmed
  /// The drawing as filmed, over its background, resized like the image; both black outside the mask of the capture.
  std::optional<ImageScores> filmed;
  double missing_MSE = 0.0;    ///< part of masked.MSE that comes from pixels of the mask where nothing is drawn
  double outline_MSE = 0.0;    ///< part of masked.MSE that comes from pixels of the mask within 3 pixels of its outline
  double foreground = 0.0;     ///< share of the mask in the crop: masked.MSE / foreground is the MSE of the person
  double drawn_detail = 0.0;   ///< detail_energy (sharpness.h) of the drawing, inside both mask and drawing
  double filmed_detail = 0.0;  ///< the same of the image
  std::optional<double> LPIPS;  ///< with EvaluationOptions::lpips: of the images of `masked`
  // With EvaluationOptions::whole_frames, of the whole image at the camera's resolution, without lens distortion:
  std::optional<ImageScores> whole;       ///< both images black outside the mask of the capture
  std::optional<ImageScores> whole_full;  ///< the drawing over the empty studio, if the capture has it, as filmed
};

struct PhotometricResult {
  std::vector<std::pair<std::string, PhotometricScores>> cameras;  ///< mean over the camera's frames
  PhotometricScores mean;                                          ///< over cameras
  double seconds = 0.0;                                            ///< to draw one image, mean

  nlohmann::ordered_json to_json() const;
};

/// Draws every frame of a split in every camera and compares the drawings with the prepared crops, and with the whole
/// images of the capture if `options` says so (see photometric_protocol). Views without the person do not count.
/// Drawings are rounded to 8 bits first, as in a file.
/// @throws UsageError for an unknown camera, or a drawing of another shape; Error when no camera sees the person; the
/// errors of WholeFrames
PhotometricResult evaluate_images(const Dataset& dataset, Split split, const ImageFunction& render,
                                  const EvaluationOptions& options, const std::string& title);

/// The conditions of the evaluation, printed with its results.
nlohmann::ordered_json photometric_protocol(const Dataset& dataset, const EvaluationOptions& options = {});

}  // namespace doppel
