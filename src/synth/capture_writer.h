#pragma once

#include <filesystem>
#include <fstream>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "doppel/synth/studio.h"
#include "doppel/synth/synth_options.h"

namespace doppel::synth {

/// Writes the sequences of a capture folder in the layout of the public datasets.
class SequenceWriter {
 public:
  /// @param folder of the sequence, e.g. `<capture>/training`
  SequenceWriter(const std::filesystem::path& folder, const std::vector<Camera>& cameras, double fps);

  void write_shot(int camera, const Studio::Shot& shot);
  /// Landmarks as an OpenPose BODY_25 file. @param body25 x, y, confidence of the 25 points
  void write_keypoints(int camera, int frame, const std::vector<double>& body25);
  /// The same landmarks as 3D estimates of a network, one row each in the camera's table.
  /// @param points [25] relative to the root, camera axes, metres; not finite: no estimate
  void write_joints(int camera, int frame, const std::vector<Eigen::Vector3d>& points);
  void write_motion_rows(const Motion& motion);
  /// Completes the videos.
  void close();

 private:
  std::filesystem::path folder_;
  std::vector<long> shots_;  ///< images written, by camera
  std::vector<cv::VideoWriter> images_, masks_;
  std::vector<std::ofstream> joints_;  ///< one table per camera
  std::vector<std::string> names_;     ///< [25] of the points
};

/// "007"
std::string three_digits(int number);

/// The skeleton's landmark for each BODY_25 point, -1 where there is none.
std::vector<int> body25_markers(const Skeleton& skeleton);

/// The text of `capture.yaml` and `README.txt`.
/// The files of the calibration in its folder. The first one is that of capture.yaml. Skeletool text defines no fisheye
/// lens.
std::vector<std::string> calibration_files(const SynthOptions& options);
std::string capture_yaml(const SynthOptions& options, const std::string& name);
std::string readme_text(const SynthOptions& options);

}  // namespace doppel::synth
