#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "doppel/detect/networks/network_options.h"
#include "doppel/detect/networks/output_adapter.h"

namespace doppel {

/// A person in an image. Pixels, first pixel centre at (0.5, 0.5).
struct PersonFinding {
  std::vector<NetworkPoint> points;  ///< [K]; empty when the network finds only a mask
  cv::Mat mask;                      ///< 8-bit, of the image's size, probability * 255; empty without a network for it
};

/// Finds one person in an image with networks of the user's choice. docs/detect.md explains the options.
///
/// Without a crop the network sees the whole image. With a crop it sees the person: the box is that of the points (or
/// of the mask) in the image before, or a network for boxes finds it, or it is the whole image. So the images of a
/// video are given in their order. Not thread-safe.
class PersonNetwork {
 public:
  /// @param points K, that the network must find; 0: a mask
  /// @throws as ImageNetwork, for each network; UsageError when a crop has no fixed input size
  PersonNetwork(const PersonNetworkOptions& options, int points);
  ~PersonNetwork();
  PersonNetwork(const PersonNetwork&) = delete;
  PersonNetwork& operator=(const PersonNetwork&) = delete;
  PersonNetwork(PersonNetwork&&) noexcept;
  PersonNetwork& operator=(PersonNetwork&&) noexcept;

  /// @param image 8-bit BGR
  /// @return nothing when no point is seen (without points: when the mask is empty)
  /// @throws UsageError for another image; Error when a network cannot run, or its outputs do not have the form wanted
  std::optional<PersonFinding> find(const cv::Mat& image);

  /// Forgets where the person was. @param near of several boxes, the next person is that of the nearest one to this
  /// pixel; not given: that of the best one
  void restart(std::optional<Eigen::Vector2d> near = std::nullopt);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The box around points that are seen, a quarter larger than they span: hands and the top of the head are beyond the
/// outermost points. @return nothing for fewer than two points
std::optional<PersonBox> box_of_points(const std::vector<NetworkPoint>& points);

}  // namespace doppel
