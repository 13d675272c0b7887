#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/capture/capture.h"
#include "doppel/capture/joint_detections.h"
#include "doppel/energy/evidence.h"

namespace doppel {

/// A sequence as it is tracked: frames `first_frame`..`last_frame` of it, counted as rows of the motion to be.
struct FootageSequence {
  int index = 0;  ///< its place among those of the footage
  std::string name;
  long first_frame = 0, last_frame = 0;
  std::vector<long> cuts;  ///< frames that begin a new segment
  std::string motion;      ///< the motion that the capture names already, resolved; empty: none

  long num_frames() const { return last_frame - first_frame + 1; }
  bool begins_segment(long frame) const;
  /// The cuts, counted from the first frame.
  std::vector<long> cuts_from_first() const;
};

/// What was seen of one instant, and what it was seen in.
struct FootageFrame {
  FrameEvidence evidence;      ///< [C]
  std::vector<cv::Mat> masks;  ///< [C] 0 or 255, without lens distortion
  std::vector<cv::Mat>
      images;  ///< [C] BGR, without lens distortion; only where asked for, and empty where there are none
  /// [C] of [M] joints in space; none for a camera without a table of them
  std::vector<std::vector<JointDetection>> joints;
};

/// The frames of one sequence in order.
class FootageReader {
 public:
  virtual ~FootageReader() = default;
  /// @param frame larger than any asked for before @param images whether they are wanted too
  virtual FootageFrame read(long frame, bool images) = 0;
  /// An image alone, without finding its mask. @param frame as above @param camera place of it
  /// @return as in `FootageFrame::images`
  virtual cv::Mat image(long frame, int camera) = 0;
};

/// Keypoints and masks of a capture, either read from its own files or from what `doppel prepare` made of them. Motion
/// and, unless masks are cut out of them, videos are not needed.
class Footage {
 public:
  virtual ~Footage() = default;
  /// @param capture_or_prepared a capture's folder or capture.yaml, or a prepared folder
  /// @param outline_pixels side of the windows of the outline fields
  /// @param camera the only one to use, by name; empty: those the capture uses
  /// @throws Error as `find_capture`, `Dataset::open` and `plan_evidence`; Error when the capture has no keypoints
  static std::unique_ptr<Footage> open(const std::filesystem::path& capture_or_prepared, int outline_pixels,
                                       const std::string& camera = "");

  virtual const Capture& capture() const = 0;
  virtual const Character& character() const = 0;
  virtual const std::vector<Camera>& cameras() const = 0;    ///< [C] without distortion
  virtual const std::vector<Marker>& landmarks() const = 0;  ///< [M]
  virtual const std::vector<FootageSequence>& sequences() const = 0;
  /// @param sequence place of it
  virtual std::unique_ptr<FootageReader> read(int sequence) const = 0;
};

}  // namespace doppel
