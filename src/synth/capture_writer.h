#pragma once

#include <filesystem>
#include <map>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/synth/studio.h"
#include "doppel/synth/synth_options.h"
#include "doppel/synth/takes.h"

namespace doppel::synth {

/// "007"
std::string three_digits(int number);

/// The files of one camera of a sequence, in the layout of the public datasets.
struct CameraFiles {
  /// @param folder of the sequence, e.g. `<capture>/training` @param tables see SynthOptions::keypoint_tables
  CameraFiles(const std::filesystem::path& folder, int camera, bool tables);

  std::filesystem::path video, masks, keypoints, joints;  ///< `keypoints`: a table, or a folder with a file per image
  std::string stream;                                     ///< "stream007"
  bool table;                                             ///< whether `keypoints` is a table

  /// Whether all files are there. The table of joints is written last.
  bool complete() const { return std::filesystem::exists(joints); }
};

/// Writes the files of one camera of a sequence.
class CameraWriter {
 public:
  CameraWriter(CameraFiles files, const Camera& camera, double fps);

  void write_shot(const Studio::Shot& shot);
  /// @param body25 x, y, confidence of the 25 points of BODY_25
  void write_keypoints(int frame, const std::vector<double>& body25);
  /// The same landmarks as 3D estimates of a network.
  /// @param points [25] relative to the root, camera axes, metres; not finite: no estimate
  void write_joints(int frame, const std::vector<Eigen::Vector3d>& points);
  /// Completes the files.
  void close();

 private:
  CameraFiles files_;
  long shots_ = 0;  ///< images written
  cv::VideoWriter images_, masks_;
  PointLayout layout_;
  std::map<long, People> keypoints_;  ///< by frame, where they go into a table
  std::string joints_;                ///< the table so far
};

/// Writes the poses of a sequence. @param folder of the sequence
void write_motion_rows(const std::filesystem::path& folder, const Motion& motion);
/// Where write_motion_rows writes them.
std::filesystem::path motion_rows_file(const std::filesystem::path& folder);

/// The files of the calibration in its folder. The first one is that of capture.yaml. Skeletool text defines no fisheye
/// lens.
std::vector<std::string> calibration_files(const SynthOptions& options);
/// The text of `capture.yaml` and `README.txt`.
std::string capture_yaml(const SynthOptions& options, const std::vector<SequencePlan>& sequences,
                         const std::string& name);
/// `README.txt` begins with kReadmeBeginning, by which a synthetic capture is known.
inline constexpr const char* kReadmeBeginning = "A synthetic capture, made by `doppel synth`";
std::string readme_text(const SynthOptions& options, const std::vector<SequencePlan>& sequences);

}  // namespace doppel::synth
