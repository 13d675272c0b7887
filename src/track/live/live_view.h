#pragma once

/// The evidence of live images: mask, keypoints and 3D joints, one image at a time.

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/evidence.h"
#include "doppel/data/capture/mask_source.h"
#include "doppel/geometry/undistorter.h"
#include "doppel/track/footage.h"
#include "doppel/track/live/frame_source.h"
#include "doppel/track/live/network_finder.h"

namespace doppel {

/// Finds the keypoints of people in an image. @return nothing when no person is found; pixels of the distorted image
using PeopleFinder = std::function<std::optional<People>(const SourceImage& image)>;
/// Finds 3D joints. @param seen image, mask and keypoints of one frame, without lens distortion @return [M] or empty
using JointFinder = std::function<std::vector<JointDetection>(const FootageFrame& seen)>;

struct LiveViewOptions {
  std::string camera;        ///< of the capture; empty: its only camera
  std::string sequence;      ///< whose masks and keypoints belong to the images; empty: the first sequence
  int outline_pixels = 256;  ///< side of the window of the outline field
  bool from_camera = false;  ///< no files belong to the images: keypoints come from the capture's detector
  /// BlazePose finds keypoints, 3D joints and masks, instead of the capture's files and its detector.
  std::optional<BlazePoseModel> blazepose;
};

/// The evidence of one camera's live images. A capture supplies the rest: character, calibration, landmarks and their
/// map, the way masks are found, and the source of keypoints (tables or files by frame, or a detector). A network can
/// be the source of all evidence.
///
/// The two stages use separate data, so that each may run on its own thread.
class LiveView {
 public:
  /// @param capture a capture's folder or capture.yaml @param images size of the images
  /// @throws Error as `find_capture` and `plan_evidence`; UsageError when the capture has several cameras and none is
  /// named, or it names no source of keypoints
  LiveView(const std::filesystem::path& capture, cv::Size images, const LiveViewOptions& options = {});

  const Capture& capture() const { return capture_; }
  const Character& character() const { return character_; }
  const PinholeCamera& camera() const { return undistort_.pinhole(); }
  const std::vector<Marker>& landmarks() const { return plan_.landmarks; }

  /// Learns the empty scene for masks, instead of the capture's masks. @param images with lens distortion
  /// @throws Error when `images` is empty
  void learn_empty_scene(const std::vector<cv::Mat>& images);
  /// Sets a finder of 3D joints that replaces the capture's table.
  void find_joints_by(JointFinder finder) { joint_finder_ = std::move(finder); }

  /// The first stage: image and mask without lens distortion, and the outline field. When a network finds the masks, it
  /// runs here, and mask and outline field are made in the second stage.
  FootageFrame preprocess(const SourceImage& image);
  /// The second stage: keypoints, and 3D joints where the capture or a finder supplies them.
  void detect(const SourceImage& image, FootageFrame& seen) const;
  /// Whether `detect` runs no network: it only reads keypoints and joints from files.
  bool detects_at_once() const { return people_ && !joint_finder_ && !masks_by_network(); }

 private:
  void open_masks(long frame);
  bool masks_by_network() const { return network_masks_ && !masks_; }
  void look(const cv::Mat& image, const std::function<cv::Mat()>& mask, FootageFrame& seen) const;
  std::vector<JointDetection> joints(long frame, const FootageFrame& seen) const;

  Capture capture_;
  Character character_;
  EvidencePlan plan_;
  LiveViewOptions options_;
  SequenceEntry entry_;
  CaptureCameras filmed_;  ///< one camera, with its distortion
  Undistorter undistort_;
  LandmarkPicker picker_;
  PeopleFinder people_;              ///< files by frame
  NetworkFinder network_;            ///< used without `people_`
  bool network_masks_ = false;       ///< unless an empty scene was learnt
  MaskSource cutter_;                ///< for the masks of the network
  std::optional<MaskSource> masks_;  ///< opened for the first image
  long last_frame_ = -1;
  std::map<long, std::vector<JointDetection>> joint_table_;
  JointFinder joint_finder_;
};

}  // namespace doppel
