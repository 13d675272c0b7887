#pragma once

#include <torch/types.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/data/dataset/dataset.h"

namespace doppel {

class Lpips;
struct Character;

/// Pixels of two masks a and b (non-zero = inside).
struct Overlap {
  std::int64_t intersection = 0, united = 0;
  std::int64_t only_b = 0;  ///< in b, not in a
  /// Intersection over union; nothing when both masks are empty.
  std::optional<double> iou() const {
    if (united == 0) return std::nullopt;
    return static_cast<double>(intersection) / static_cast<double>(united);
  }
  Overlap& operator+=(const Overlap& other) {
    intersection += other.intersection;
    united += other.united;
    only_b += other.only_b;
    return *this;
  }
};
Overlap overlap(const std::uint8_t* a, const std::uint8_t* b, std::int64_t count);

/// The cameras and frames of an evaluation, and the measurements that need other data than the prepared capture.
struct EvaluationOptions {
  std::vector<std::string> cameras;    ///< names; empty: all of the capture
  int every = 1;                       ///< every n-th frame of a sequence
  std::vector<long> frames;            ///< rows of the motions, of any of the splits; empty: all that `every` leaves
  std::string input_camera;            ///< the camera whose images were the method's input; empty: none
  bool whole_frames = false;           ///< compare drawings with the whole images of the capture too (slow)
  bool flicker = false;                ///< measure the flicker of drawings too (flicker.h)
  std::shared_ptr<const Lpips> lpips;  ///< measures drawings too; null: no LPIPS
  std::filesystem::path scans;         ///< folder of scans (scans.h) to measure surfaces against; empty: none
  double scan_unit = 0.001;            ///< of the scans, metres
  bool ground_truth = true;            ///< compare with the true surfaces of the capture, if it has them
};

/// The frames of a split that are compared: of `options.frames`, those that the split has.
/// @throws UsageError when the split has no sequence, or none of the frames
std::vector<SampleId> evaluated_samples(const Dataset& dataset, Split split, const EvaluationOptions& options);

/// A surface as a function of the frame: vertices [B,N,3] float32, world metres, for B samples.
using SurfaceFunction = std::function<torch::Tensor(const std::vector<SampleId>&)>;

/// How well a surface matches the masks of a split.
struct SurfaceResult {
  std::vector<std::pair<std::string, double>> cameras;  ///< IoU per camera, mean over its frames
  double AMVIoU = 0.0;                                  ///< mean over cameras
  std::optional<double> SVIoU, RVIoU;                   ///< IoU of the input camera, mean IoU of the others
  std::optional<double> hand_IoU;  ///< IoU in squares around the hands (HandBoxes), mean over hands, frames, cameras
  /// Pixels that the surface covers outside the mask, and pixels of the mask that the surface does not cover, as shares
  /// of the pixels of all unions. A surface that is too wide increases `outside`, one that is too thin `missing`.
  double outside = 0.0, missing = 0.0;
  // Where the true vertices are known:
  std::optional<double> vertex_error_mm;      ///< mean distance to the true vertices
  std::optional<double> Hausdorff_mm;         ///< distance to the true surface (surface_metrics.h), mean over frames
  std::optional<double> surface_distance_mm;  ///< mean distance of both surfaces, mean over frames
  /// Mean distance to the true surface of the vertices that some camera of the capture sees on the true surface. Only
  /// these could be compared with a reconstruction from the images (Table 6.6).
  std::optional<double> seen_distance_mm;
  // Of the shape (surface_shape.h): how spikes and folds differ from those of the true surface.
  std::optional<double> normal_error_deg;     ///< mean angle between the vertex normals
  std::optional<double> roughness_error_mm;   ///< roughness of the difference from the true surface
  std::optional<double> roughness_ratio;      ///< roughness of the displacements over that of the true ones
  std::optional<double> border_length_ratio;  ///< length of hems and other borders over the true length
  /// With EvaluationOptions::scans: mean distance of all vertices to the scan, in this direction only, mean over the
  /// frames that have a scan (Table 6.6).
  std::optional<double> scan_distance_mm;

  nlohmann::ordered_json to_json() const;
};

/// AMVIoU (5.8): the surface is drawn with the camera at the full resolution of its image, without distortion, and
/// compared with the full mask; IoU is averaged over the frames of a camera, then over cameras. A view in which both
/// are empty does not count. If the capture has `ground_truth/<sequence>/vertices.npy` [frames of the motion,N,3]
/// (metres), the result contains the errors against it.
/// @param character of the capture: its faces, labels and skinned template
/// @param skinned the skinned template in the poses of the surface, from which displacements are measured; empty: in
/// the poses of the capture
/// @throws UsageError for an unknown camera, or an input camera that is not among those compared, and as Scans; Error
/// when no camera sees anything, or ground truth has another shape
SurfaceResult evaluate_surface(const Dataset& dataset, Split split, const Character& character,
                               const SurfaceFunction& surface, const EvaluationOptions& options,
                               const std::string& title, const SurfaceFunction& skinned = {});

/// The conditions of an evaluation, printed with its results: frames per split, cameras, resolution, mask threshold,
/// scans. @throws UsageError as Scans, for a split without sequences, and for a frame that no sequence of the splits
/// has
nlohmann::ordered_json evaluation_protocol(const Dataset& dataset, const std::vector<Split>& splits,
                                           const EvaluationOptions& options);

/// The document that `doppel evaluate --json` prints, as aligned text.
std::string evaluation_table(const nlohmann::ordered_json& evaluation);

}  // namespace doppel
