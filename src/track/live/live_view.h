#pragma once

/// What a live image shows: mask, keypoints and joints, found one image at a time.

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/capture/capture_cameras.h"
#include "doppel/capture/evidence.h"
#include "doppel/capture/mask_source.h"
#include "doppel/track/footage.h"
#include "doppel/track/live/frame_source.h"

namespace doppel {

/// Finds one person's points in an image. @return nobody when none is seen; pixels of the image as filmed
using PeopleFinder = std::function<std::optional<People>(const SourceImage& image)>;
/// Places landmarks in space. @param seen image, mask and keypoints of one frame, without lens distortion
/// @return [M] or none
using JointFinder = std::function<std::vector<JointDetection>(const FootageFrame& seen)>;

struct LiveViewOptions {
  std::string camera;        ///< of the capture; empty: its only one
  std::string sequence;      ///< the one whose masks and keypoints are described; empty: the first
  int outline_pixels = 256;  ///< side of the window of the outline's field
  bool from_camera = false;  ///< nothing on disk belongs to these images: points come from the capture's detector
};

/// One camera whose images come as they will. A capture says what stands around them: character, calibration,
/// landmarks and their map, how masks are cut out, and where points come from: tables or files by frame, or a detector.
///
/// The two stages keep what they need apart, so each may run on a thread of its own.
class LiveView {
 public:
  /// @param capture a capture's folder or capture.yaml @param images their size
  /// @throws Error as `find_capture` and `plan_evidence`; UsageError when the capture has several cameras and none is
  /// named, or nothing says where keypoints come from
  LiveView(const std::filesystem::path& capture, cv::Size images, const LiveViewOptions& options = {});

  const Capture& capture() const { return capture_; }
  const Character& character() const { return character_; }
  const Camera& camera() const { return undistort_.pinhole(); }
  const std::vector<Marker>& landmarks() const { return plan_.landmarks; }

  /// Learns the empty scene from these images instead of what the capture says of masks. @param images as filmed
  /// @throws Error when there is none
  void learn_empty_scene(const std::vector<cv::Mat>& images);
  /// Joints in space come from here instead of the capture's table.
  void find_joints_by(JointFinder finder) { joint_finder_ = std::move(finder); }

  /// The first stage: image and mask without lens distortion, and the outline's field.
  FootageFrame preprocess(const SourceImage& image);
  /// The second: keypoints, and joints where there are any.
  void detect(const SourceImage& image, FootageFrame& seen) const;

 private:
  void open_masks(long frame);
  std::vector<JointDetection> joints(long frame, const FootageFrame& seen) const;

  Capture capture_;
  Character character_;
  EvidencePlan plan_;
  LiveViewOptions options_;
  SequenceEntry entry_;
  CaptureCameras filmed_;  ///< the one, with its distortion
  Undistorter undistort_;
  LandmarkPicker picker_;
  PeopleFinder people_;
  std::optional<MaskSource> masks_;  ///< opened for the first image
  long last_frame_ = -1;
  std::map<long, std::vector<JointDetection>> joint_table_;
  JointFinder joint_finder_;
};

}  // namespace doppel
