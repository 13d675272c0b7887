#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "doppel/detect/blazepose/body_boxes.h"
#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/detect/blazepose/model_files.h"
#include "doppel/detect/keypoints/person_guide.h"

namespace doppel {

struct BodyDetectorOptions {
  BlazePoseModel model = BlazePoseModel::full;
  int threads = 1;
  bool masks = true;    ///< whether poses have a mask
  bool mirror = false;  ///< also reads the region's mirror image, and takes the mean of points: twice the time
  std::filesystem::path models{};  ///< folder of the model files; empty: `models_folder`
};

/// Finds people in images with MediaPipe's BlazePose: one network finds people and the region of each, a second one
/// finds landmarks, joints in space and the mask in a region. The weights are fetched on first use (model_files.h).
/// Not thread-safe.
///
/// Images are 8-bit BGR. A person's region is found by head and shoulders, so these should be in the image. `docs/
/// detect.md` has accuracy and speed.
class BodyDetector {
 public:
  /// @throws as `find_model` and `read_tflite`; FileError when a model has other inputs or outputs than expected
  explicit BodyDetector(const BodyDetectorOptions& options = {});
  ~BodyDetector();
  BodyDetector(const BodyDetector&) = delete;
  BodyDetector& operator=(const BodyDetector&) = delete;
  BodyDetector(BodyDetector&&) noexcept;
  BodyDetector& operator=(BodyDetector&&) noexcept;

  /// The people that the first network finds, best first. @throws UsageError unless the image is 8-bit BGR, not empty
  std::vector<BodyBox> find_boxes(const cv::Mat& image);
  /// The pose of the person in a region.
  /// @return nothing when the second network gives at most 0.5 for the probability of a person there
  std::optional<BodyPose> read_pose(const cv::Mat& image, const BodyRoi& roi);

  /// The person of the best box.
  std::optional<BodyPose> detect(const cv::Mat& image);
  /// All people, best box first.
  std::vector<BodyPose> detect_all(const cv::Mat& image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The region in which the landmark network looks for the person of a box.
BodyRoi roi_of_box(const BodyBox& box);
/// The middle of the hips, pixels.
Eigen::Vector2d hips_of(const BodyPose& pose);

/// Follows one person through the frames of a video. The region of a frame comes from the landmarks of the frame
/// before, which is faster than to detect anew, and keeps the same person among several.
class BodyTracker {
 public:
  /// @param detector must outlive the tracker
  /// @param hint pixel near the middle of the person's hips in the first frame; if not given, the best box counts
  explicit BodyTracker(BodyDetector& detector, const std::optional<Eigen::Vector2d>& hint = std::nullopt);

  /// The person in the next frame. Where nothing is found in the region of the frame before, all people are detected
  /// anew, and the one nearest to the last known position counts.
  /// @param known where the person is in this frame, if known: somebody whose hips are not there is not the person, who
  /// is then looked for there
  /// @return nothing when nobody is found, or the person is known to be invisible
  /// @throws as `BodyDetector::find_boxes`
  std::optional<BodyPose> track(const cv::Mat& image, const std::optional<PersonAnchor>& known = std::nullopt);

 private:
  std::optional<BodyPose> find_again(const cv::Mat& image, const std::optional<PersonAnchor>& known);

  BodyDetector* detector_;
  std::optional<Eigen::Vector2d> position_;  ///< last known middle of the hips, pixels
  std::optional<BodyRoi> roi_;               ///< where to look next
};

}  // namespace doppel
