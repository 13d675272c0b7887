#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/character/motion.h"
#include "doppel/capture/capture.h"
#include "doppel/capture/evidence.h"
#include "doppel/capture/prepare_options.h"
#include "doppel/capture/store_layout.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A sequence with its poses and the rows of them to prepare.
struct PlannedSequence {
  SequenceEntry entry;
  Motion motion;  ///< without frames: none is known
  long first_frame = 0, last_frame = 0;

  bool has_motion() const { return motion.num_frames() > 0; }
  long num_frames() const { return last_frame - first_frame + 1; }
};

/// A capture whose parts were found, opened and held against each other.
struct PreparePlan {
  Capture capture;
  Character character;
  std::vector<Camera> cameras;  ///< chosen ones at the resolution of their video, with distortion
  std::vector<int> file_index;  ///< [C] position in the calibration file
  std::vector<PlannedSequence> sequences;
  EvidencePlan evidence;
  StoreLayout layout;  ///< what the store will say about itself

  /// Absolute path or image pattern of one camera.
  std::string source(const std::string& pattern, int camera) const;
  /// Whether the sequence's keypoints are to be found by the capture's detector.
  bool detects(const PlannedSequence& sequence) const {
    return capture.detector && sequence.entry.keypoints.empty() && !evidence.landmarks.empty();
  }
  /// The table that these keypoints of one camera are kept in; `{name}` in place of the camera.
  static std::string detected_table(const PlannedSequence& sequence, const std::filesystem::path& out);
};

/// Reads everything but the images, and stops with a plain sentence when counts, sizes, units or cameras cannot be
/// right: frame counts of video, masks and motion; image sizes against the calibration; the character's size; the
/// cameras' distance and direction.
PreparePlan plan_preparation(const Capture& capture, const PrepareOptions& options);

/// Throws, or only warns with `options.force`.
void stop_or_warn(const PrepareOptions& options, const std::string& sentence);

}  // namespace doppel
