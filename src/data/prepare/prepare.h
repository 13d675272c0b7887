#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/evidence.h"
#include "doppel/data/prepare/prepare_options.h"

namespace doppel {

/// Statistics of one camera in one sequence. Shares are from 0 to 1.
struct CameraReport {
  std::string sequence, camera;       ///< names
  long frames = 0, empty_frames = 0;  ///< number of prepared frames, and of those in which the mask is empty
  double coverage = 0.0;              ///< mean share of the image that the person covers, empty frames included
  double border_touch = 0.0;          ///< share of the frames whose mask touches the image's border
  double template_iou = 0.0;  ///< median IoU of the skinned template and the mask on the checked frames; 0: no frame
                              ///< was checked
  int checked_frames = 0;  ///< frames in which template and mask were compared; 0: the sequence has no motion, or the
                           ///< masks are empty
  std::optional<KeypointFacts> keypoints;  ///< nothing when the capture has no keypoints or no landmarks for them
};

struct PrepareReport {
  bool finished = false;              ///< false: stopped by Ctrl-C or SIGTERM; the next call continues
  long records = 0, new_records = 0;  ///< records in the store (one per frame and camera), and those added by this call
  std::vector<CameraReport> cameras;  ///< by sequence, then by camera; empty unless `finished`. A shard reports its own
                                      ///< cameras, without keypoints

  std::string table() const;  ///< `cameras` as a text table, one line for each; shares in percent
  std::string json() const;   ///< `finished`, `records` and `cameras` as JSON; shares from 0 to 1
};

/// Prepares a capture: writes cropped masks and images to a store in `options.out`, one record for each frame and
/// camera. At the end it writes the prepared `capture.yaml` and `report.json` there.
///
/// Each video is decoded once, from the first frame to the last, in bounded memory. It is decoded a second time if the
/// capture's detector has to find the keypoints. A run may be killed at any moment. Another call with the same options
/// continues it and gives the same records.
///
/// With `options.shard`, only the records of that shard are made. With `options.shards`, the records are copied from
/// there, in the order in which one thread makes them, so that the store has the same bytes. Keypoints are put on
/// landmarks then, because the choice of one person needs all cameras. A sequence without a motion is prepared too. Its
/// rows are the frames that all of its videos have.
/// @throws UsageError for options out of range, and when `options.out` is the folder of the capture itself
/// @throws Error when `options.out` was prepared with other settings (unless `options.overwrite` is set), or when frame
/// counts or image sizes disagree. Units, camera directions, masks or keypoint files that are probably wrong are errors
/// too; with `options.force` they are warnings.
PrepareReport prepare_capture(const Capture& capture, const PrepareOptions& options);

}  // namespace doppel
