#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "doppel/core/fetch/package_files.h"
#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/detect/face/face_pose.h"

namespace doppel {

struct NetworkModel;

/// The package of the network of faces: MediaPipe's, under the Apache License 2.0. The file holds several networks.
extern const Package kFacePackage;
inline constexpr PackageFile kFaceFile = {"face_mesh_solution_packed_assets.data",
                                          "dbe5905c582c0462cdaea17e7e6ecea92edaa8cccc515c5e2e7291f2cbb5fb99"};

/// Reads faces in regions of images with MediaPipe's face mesh, the network without attention. The weights are fetched
/// on first use. Not thread-safe.
class FaceDetector {
 public:
  /// @param models folder of the model file; empty: `models_folder`
  /// @throws as `find_package_file` and `read_tflite`; FileError when the model has other inputs or outputs than
  /// expected
  explicit FaceDetector(int threads = 1, const std::filesystem::path& models = {});
  /// A network that has been read (blazepose/tflite_model.h). @throws FileError as above
  explicit FaceDetector(const NetworkModel& model, int threads = 1);
  ~FaceDetector();
  FaceDetector(const FaceDetector&) = delete;
  FaceDetector& operator=(const FaceDetector&) = delete;
  FaceDetector(FaceDetector&&) noexcept;
  FaceDetector& operator=(FaceDetector&&) noexcept;

  /// The face in a region of an 8-bit BGR image.
  /// @param roi not mirrored
  /// @return nothing when the network gives less than 0.5 for the probability of a face there
  /// @throws UsageError unless the image is 8-bit BGR, not empty
  std::optional<FacePose> read_face(const cv::Mat& image, const BodyRoi& roi);
  /// The face of a body in its image, by `find_face` (face_search.h). @throws as above
  std::optional<FacePose> read_face(const cv::Mat& image, const BodyPose& body);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
