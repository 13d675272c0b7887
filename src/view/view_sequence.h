#pragma once

#include <string>

#include "doppel/data/capture/capture.h"
#include "doppel/track/points/point_motion.h"
#include "doppel/view/view_cameras.h"

namespace doppel {

/// A sequence of a capture without a character: the page shows what its cameras filmed.
struct ViewSequence {
  std::string name;    ///< of the capture and the sequence
  long first_row = 0;  ///< row of the sequence's motion that is frame 0 of the page
  long frames = 0;     ///< at least 1
  PointMotion points;  ///< the person's points in these frames; no point without keypoints
};

/// The rows that all of these cameras filmed. Points need keypoints of two cameras; where they cannot be found, a line
/// of the log says why, and the cameras are shown without them.
/// @throws Error and FileError as rows_of_sequence
ViewSequence open_view_sequence(const Capture& capture, const SequenceEntry& sequence, const ViewCameras& cameras);

}  // namespace doppel
