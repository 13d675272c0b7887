#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "doppel/core/fetch/package_files.h"
#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/detect/hands/hand_pose.h"

namespace doppel {

struct NetworkModel;

/// The package of the network of hands: MediaPipe's, under the Apache License 2.0.
extern const Package kHandPackage;
inline constexpr PackageFile kHandFile = {"hand_landmark_full.tflite",
                                          "8c026882c9ec059ce0f8e75266bee5a9a23c341a40e0000df755374d3d1b9b68"};

/// Reads hands in regions of images with MediaPipe's network of hands. The weights are fetched on first use. Not
/// thread-safe.
class HandDetector {
 public:
  /// @param models folder of the model file; empty: `models_folder`
  /// @throws as `find_package_file` and `read_tflite`; FileError when the model has other inputs or outputs than
  /// expected
  explicit HandDetector(int threads = 1, const std::filesystem::path& models = {});
  /// A network that has been read (blazepose/tflite_model.h). @throws FileError as above
  explicit HandDetector(const NetworkModel& model, int threads = 1);
  ~HandDetector();
  HandDetector(const HandDetector&) = delete;
  HandDetector& operator=(const HandDetector&) = delete;
  HandDetector(HandDetector&&) noexcept;
  HandDetector& operator=(HandDetector&&) noexcept;

  /// The hand in a region of an 8-bit BGR image.
  /// @return nothing when the network gives less than 0.5 for the probability of a hand there
  /// @throws UsageError unless the image is 8-bit BGR, not empty
  std::optional<HandPose> read_hand(const cv::Mat& image, const BodyRoi& roi);
  /// The hands of a body in its image, by `find_hands` (hand_search.h). @throws as `read_hand`
  HandPair read_hands(const cv::Mat& image, const BodyPose& body);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
