#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/capture/capture.h"
#include "doppel/capture/evidence.h"
#include "doppel/capture/prepare_options.h"

namespace doppel {

/// Statistics of one camera in one sequence.
struct CameraReport {
  std::string sequence, camera;
  long frames = 0, empty_frames = 0;
  double coverage = 0.0;      ///< mean share of the image that the person covers
  double border_touch = 0.0;  ///< share of the frames whose mask touches the image's border
  double template_iou = 0.0;  ///< median IoU of the skinned template and the mask on `checked_frames` frames
  int checked_frames = 0;     ///< 0: the sequence has no motion, or the person is in none of its masks
  std::optional<KeypointFacts> keypoints;  ///< where the capture has keypoints and landmarks
};

struct PrepareReport {
  bool finished = false;  ///< false: stopped by Ctrl-C; the next call continues
  long records = 0, new_records = 0;
  std::vector<CameraReport> cameras;

  std::string table() const;  ///< readable text
  std::string json() const;   ///< the same as JSON
};

/// Turns a capture into a store of cropped masks and images, one record per frame and camera. Each video is decoded
/// once, in order, in bounded memory, and once more if the capture's detector finds the keypoints. A run that was
/// killed at any moment can be continued; the records are the same. A sequence without a motion is prepared too: in
/// place of the motion's rows, the frames that all of its videos have.
/// @throws Error when frame counts, sizes, units or camera directions cannot be right, or when `options.out` was
/// prepared with other settings
PrepareReport prepare_capture(const Capture& capture, const PrepareOptions& options);

}  // namespace doppel
