#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/data/capture.h"
#include "doppel/data/evidence.h"

namespace doppel {

struct PrepareOptions {
  std::filesystem::path out;  ///< folder for capture.yaml, store/ and report.json
  int mask_size = 350;        ///< side of the cropped masks (thesis A.2)
  int image_size = 512;       ///< side of the cropped pictures
  double margin = 0.1;        ///< around the mask's box, of its longer side
  int jpeg_quality = 95;      ///< of the cropped pictures; 0: lossless PNG
  int threads = 1;            ///< cameras worked on at once (two at most)
  int chunk_frames = 16;      ///< frames per transaction
  long limit_frames = 0;      ///< only so many frames of each sequence; 0: all
  bool overwrite = false;     ///< throw away what was prepared with other settings
  bool force = false;         ///< go on where a check would stop, with a warning
};

/// What was found of one camera in one sequence.
struct CameraReport {
  std::string sequence, camera;
  long frames = 0, empty_frames = 0;
  double coverage = 0.0;      ///< mean share of the picture that is person
  double border_touch = 0.0;  ///< share of the frames whose mask touches the picture's border
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

/// Turns a capture into a store of cropped masks and pictures, one record per frame and camera. Each video is decoded
/// once, in order, in bounded memory, and once more where the capture's detector looks for keypoints. Killed at any
/// moment it goes on where it was; the records come out the same. A sequence without a motion is prepared as well: its
/// rows are the frames that all of its videos have.
/// @throws Error with a plain sentence when frame counts, sizes, units or camera directions cannot be right, or when
///         `options.out` was prepared with other settings
PrepareReport prepare_capture(const Capture& capture, const PrepareOptions& options);

}  // namespace doppel
