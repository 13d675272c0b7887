#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/eval/image_metrics.h"

namespace doppel {

/// The surface points of one frame that one camera sees, float32 [P,3], world metres.
using CloudFunction = std::function<torch::Tensor(const ImageRequest&)>;

/// The distance of point clouds from the true surface: their noise (Fig. 6.16).
struct CloudResult {
  double surface_distance_mm = 0.0;                     ///< mean distance of a point
  double noise_mm = 0.0;                                ///< root mean squared distance
  double median_mm = 0.0, p99_mm = 0.0;                 ///< median and 99th percentile of the distance
  double points = 0.0;                                  ///< per cloud, mean
  std::vector<std::pair<std::string, double>> cameras;  ///< mean distance of each, mm

  nlohmann::ordered_json to_json() const;
};

/// @param faces int32 [F,3] of the true surface @param num_vertices of the true surface
/// @return nothing when no frame has ground truth, or all clouds are empty
/// @throws UsageError for an unknown camera; Error when ground truth has another shape
std::optional<CloudResult> evaluate_clouds(const Dataset& dataset, Split split, const torch::Tensor& faces,
                                           std::int64_t num_vertices, const CloudFunction& cloud,
                                           const EvaluationOptions& options, const std::string& title);

}  // namespace doppel
