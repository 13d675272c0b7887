#pragma once

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"

namespace doppel {

/// The cameras of a capture at the resolution of the first sequence's videos, in whose pixels keypoints are given.
/// Cameras without a video stay as calibrated, and a line of the log says so.
/// @throws Error and FileError as choose_cameras, fit_to_images and open_frames
CaptureCameras filmed_cameras(const Capture& capture);

/// Whether the video of a camera exists. Images that are a file for each frame are taken to exist.
bool has_images(const Capture& capture, const SequenceEntry& sequence, const Camera& camera, int file_index);

/// Consecutive rows of a motion. Both ends belong to it.
struct RowRange {
  long first = 0, last = 0;
};

/// The rows of a sequence that are used: from its `first_frame` to its `last_frame` or, if it states none, to the last
/// row that the masks, or without mask files the videos, of all cameras have. The sequence may have no video if it
/// states `last_frame`.
/// @throws Error when some camera lacks a row; FileError as open_frames
RowRange rows_of_sequence(const Capture& capture, const SequenceEntry& sequence, const CaptureCameras& filmed);

}  // namespace doppel
