#pragma once

#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"

namespace doppel {

/// The points of one person in all cameras of a sequence, in the order of the detector's layout. The person is chosen
/// by the agreement of the cameras, or as the capture's key `person` says (people_in_cameras.h). No character is
/// needed.
/// @param filmed filmed_cameras(capture), or other values for these cameras
/// @return cameras in the order of `filmed`. Points are in pixels as filmed, at the resolution of the
/// videos. Frames are those of the camera's video, from 0; frames outside of the sequence have no points. Time 0 is
/// that of row 0 of the motion, so `offset` is the capture's `frame_offset`.
/// @throws Error when the sequence names no keypoints, or as follow_people; FileError as the readers
PointTracks read_person_tracks(const Capture& capture, const SequenceEntry& sequence, const CaptureCameras& filmed);

/// The same for a rig whose calibration or offsets are in doubt. Where no camera found several people, these are taken
/// as they are. Otherwise the cameras need to agree only roughly, and each offset may be many frames off.
PointTracks read_tracks_of_rough_rig(const Capture& capture, const SequenceEntry& sequence,
                                     const CaptureCameras& filmed);

}  // namespace doppel
