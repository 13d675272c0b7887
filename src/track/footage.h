#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/data/capture/capture.h"
#include "doppel/detect/keypoints/joint_detections.h"
#include "doppel/track/energy/evidence.h"

namespace doppel {

/// A sequence to track: its frames `first_frame`..`last_frame`, counted as rows of the resulting motion.
struct FootageSequence {
  int index = 0;  ///< index in `Footage::sequences`
  std::string name;
  long first_frame = 0, last_frame = 0;
  std::vector<long> cuts;  ///< frames that begin a new segment
  std::string motion;      ///< path of the motion that the capture already names; empty: none
  bool has_masks = true;

  long num_frames() const { return last_frame - first_frame + 1; }
  bool begins_segment(long frame) const;
  /// The cuts, counted from the first frame.
  std::vector<long> cuts_from_first() const;
};

/// One frame: the evidence, and the masks and images behind it. Without masks the outlines are empty.
struct FootageFrame {
  FrameEvidence evidence;       ///< [C]
  std::vector<cv::Mat> masks;   ///< [C] 0 or 255, without lens distortion; empty where the sequence has no masks
  std::vector<cv::Mat> images;  ///< [C] BGR, without lens distortion; only if requested, and empty where there are none
  /// [C][M] 3D joints; empty for a camera without a table of joints
  std::vector<std::vector<JointDetection>> joints;
};

/// Reads the frames of one sequence in order.
class FootageReader {
 public:
  virtual ~FootageReader() = default;
  /// @param frame larger than in all earlier calls @param images whether to read images too
  virtual FootageFrame read(long frame, bool images) = 0;
  /// Reads an image without its mask. @param frame as for `read` @param camera index
  /// @return as in `FootageFrame::images`
  virtual cv::Mat image(long frame, int camera) = 0;
};

/// Keypoints, masks and images of a capture, read from its own files or from the prepared capture. No motion is needed.
/// Videos are needed only where masks are computed from them.
class Footage {
 public:
  virtual ~Footage() = default;
  /// @param capture_or_prepared a capture's folder or capture.yaml, or a prepared capture
  /// @param outline_pixels side of the windows of the outline fields
  /// @param camera name of the only camera to use; empty: those that the capture uses
  /// @throws Error as `find_capture`, `Dataset::open` and `plan_evidence`; Error when the capture has no character or
  /// no keypoints
  static std::unique_ptr<Footage> open(const std::filesystem::path& capture_or_prepared, int outline_pixels,
                                       const std::string& camera = "");
  /// As above, of a capture that is not prepared. @param reason why no other will do, for the message
  /// @throws UsageError for a prepared capture
  static std::unique_ptr<Footage> open_unprepared(const std::filesystem::path& capture, int outline_pixels,
                                                  const std::string& reason);
  /// As `open`, of a capture that is not prepared, for another character than the capture's. The landmarks are the
  /// character's markers; `capture()` names `file` as the character.
  /// @throws UsageError for a prepared capture
  static std::unique_ptr<Footage> open_for(Character character, const std::filesystem::path& file,
                                           const std::filesystem::path& capture, int outline_pixels);

  /// As `open`, of a capture that is not prepared, with the landmarks of another placement file, which `capture()`
  /// names.
  /// @throws UsageError for a prepared capture
  static std::unique_ptr<Footage> open_with_landmarks(const std::filesystem::path& placement,
                                                      const std::filesystem::path& capture, int outline_pixels);

  virtual const Capture& capture() const = 0;
  virtual const Character& character() const = 0;
  virtual const std::vector<PinholeCamera>& cameras() const = 0;  ///< [C]
  virtual const std::vector<Marker>& landmarks() const = 0;       ///< [M]
  virtual const std::vector<FootageSequence>& sequences() const = 0;
  /// @param sequence index in `sequences`
  virtual std::unique_ptr<FootageReader> read(int sequence) const = 0;
};

}  // namespace doppel
