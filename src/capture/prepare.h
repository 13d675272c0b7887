#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/capture/capture.h"
#include "doppel/capture/evidence.h"
#include "doppel/capture/prepare_options.h"

namespace doppel {

/// What was found of one camera in one sequence.
struct CameraReport {
  std::string sequence, camera;
  long frames = 0, empty_frames = 0;
  double coverage = 0.0;      ///< mean share of the image that is person
  double border_touch = 0.0;  ///< share of the frames whose mask touches the image's border
  double template_iou = 0.0;  ///< median IoU of the skinned template and the mask on `checked_frames` frames
  int checked_frames = 0;     ///< 0: the sequence has no motion, or the person is in none of its masks
  std::optional<KeypointFacts> keypoints;  ///< where the capture has keypoints and landmarks
};

struct PrepareReport {
  bool finished = false;  ///< false: stopped by Ctrl-C; the next call goes on
  long records = 0, new_records = 0;
  std::vector<CameraReport> cameras;

  std::string table() const;  ///< for people
  std::string json() const;   ///< for machines
};

/// Turns a capture into a store of cropped masks and images, one record per frame and camera. Each video is decoded
/// once, in order, in bounded memory, and once more where the capture's detector looks for keypoints. Killed at any
/// moment it goes on where it was; the records come out the same. A sequence without a motion is prepared as well: its
/// rows are the frames that all of its videos have.
/// @throws Error with a plain sentence when frame counts, sizes, units or camera directions cannot be right, or when
///         `options.out` was prepared with other settings
PrepareReport prepare_capture(const Capture& capture, const PrepareOptions& options);

}  // namespace doppel
