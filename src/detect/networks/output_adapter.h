#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/detect/networks/image_network.h"
#include "doppel/detect/networks/network_view.h"

namespace doppel {

/// A point on the network's input or in an image, pixels, first pixel centre at (0.5, 0.5).
struct NetworkPoint {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  double score = 0.0;  ///< 0..1; 0: not seen
};

/// What an adapter reads. Positions are on the network's input.
struct NetworkResult {
  std::vector<NetworkPoint> points;  ///< [K]
  cv::Mat mask;                      ///< 32-bit, probabilities, of any size; covers the input
  std::vector<PersonBox> boxes;      ///< best first
};

/// Reads one form of outputs. There is one file for each: heatmap_output, simcc_output, points_output, mask_output,
/// box_output.
class OutputAdapter {
 public:
  virtual ~OutputAdapter() = default;
  /// @param outputs of the network @param input size of its input, pixels
  /// @throws Error when the outputs do not have the form; names the shapes found and those allowed
  virtual NetworkResult read(const std::vector<NetworkOutput>& outputs, cv::Size input) const = 0;
};

std::unique_ptr<OutputAdapter> make_heatmap_adapter(const NetworkOptions& options, int points);
std::unique_ptr<OutputAdapter> make_simcc_adapter(const NetworkOptions& options, int points);
std::unique_ptr<OutputAdapter> make_points_adapter(const NetworkOptions& options, int points);
std::unique_ptr<OutputAdapter> make_mask_adapter(const NetworkOptions& options);
/// @param kind boxes, ssd or yolox
std::unique_ptr<OutputAdapter> make_box_adapter(const NetworkOptions& options, OutputKind kind);

}  // namespace doppel
