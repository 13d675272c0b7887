#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/character/motion.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/evidence.h"
#include "doppel/data/prepare/prepare_options.h"
#include "doppel/data/prepare/store_layout.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A sequence with its motion and the rows to prepare.
struct PlannedSequence {
  SequenceEntry entry;
  Motion motion;  ///< without frames: none is known
  long first_frame = 0, last_frame = 0;

  bool has_motion() const { return motion.num_frames() > 0; }
  long num_frames() const { return last_frame - first_frame + 1; }
};

/// A capture whose parts were found, opened and checked against each other.
struct PreparePlan {
  Capture capture;
  Character character;
  std::vector<Camera> cameras;  ///< the chosen ones, at the resolution of their video, with distortion
  std::vector<int> file_index;  ///< [C] position in the calibration file
  std::vector<PlannedSequence> sequences;
  EvidencePlan evidence;
  StoreLayout layout;  ///< the description of the store

  /// The absolute path or image pattern of one camera.
  std::string source(const CameraPaths& paths, int camera) const;
  /// Whether the capture's detector must find the keypoints of a sequence.
  bool detects(const PlannedSequence& sequence) const {
    return capture.detector && sequence.entry.keypoints.empty() && !evidence.landmarks.empty();
  }
  /// The path of the table that stores these keypoints of one camera, with the placeholder `{name}` for the camera.
  static std::string detected_table(const PlannedSequence& sequence, const std::filesystem::path& out);
};

/// Reads everything but the images, and stops with an error when counts, sizes, units or cameras cannot be right.
/// Checked are the frame counts of video, masks and motion, the image sizes against the calibration, the character's
/// size, and the cameras' distance and direction.
PreparePlan plan_preparation(const Capture& capture, const PrepareOptions& options);

/// Throws an Error with `sentence`; with `options.force`, only warns.
void stop_or_warn(const PrepareOptions& options, const std::string& sentence);

}  // namespace doppel
