#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/pose_detector.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/geometry/camera.h"
#include "doppel/geometry/undistorter.h"

namespace doppel {

/// The landmarks of a capture, and the map from keypoints to these landmarks.
struct EvidencePlan {
  KeypointMap map;
  std::string map_name;           ///< name of a built-in map, "names", or a path as written
  std::vector<Marker> landmarks;  ///< [M]; none: the capture has no keypoints, or no landmarks for them
};

/// Chooses the map and the landmarks. The landmarks are those of the placement file; without a placement file, the
/// skeleton's markers that the map contains. Without `keypoint_map`, the points of a table (.csv) have the names of
/// landmarks unless they are those of a built-in layout, the layout of other files is found by their content
/// (guess_layout.h), BODY_25 if it does not decide, and the points of a detector are BODY_25. When there is no
/// landmark, the keypoints are ignored with a warning; when the capture names a map, this is an error.
/// @throws Error for a detector with the map `names`, which defines no order of points; for landmarks that the map does
/// not contain; and the errors of the readers
EvidencePlan plan_evidence(const Capture& capture, const Character& character);

/// Statistics of the keypoints of one camera in one sequence.
struct KeypointFacts {
  long frames = 0;
  long missing_files = 0;  ///< frames without a file
  long nobody = 0;         ///< frames without a detected person, missing files included
  long several = 0;        ///< frames with more than one detected person
  long unsure = 0;         ///< frames with people, but no landmark of at least kSeenConfidence
  double seen = 0.0;       ///< share of landmarks, over all frames, of at least kSeenConfidence
};

/// The keypoints of one camera in consecutive rows, one per landmark, in pixels of the image without distortion.
struct KeypointTrack {
  std::vector<std::vector<Keypoint>> frames;  ///< [F] of [M]
  KeypointFacts facts;
};

/// Functions that return the people in a video frame, and the mask of a motion row (empty: none).
using PeopleOfFrame = std::function<std::optional<People>(long frame)>;
using MaskOfRow = std::function<cv::Mat(long row)>;
/// Which of the people in a video frame is followed: the index; -1: none of them (people_in_cameras.h).
using ChoiceOfFrame = std::function<int(long frame)>;

/// Consecutive rows of a motion, as one camera filmed them.
struct FilmedRows {
  long first = 0, last = 0;
  std::vector<long> cuts;  ///< rows that begin a new segment
  FrameClock clock;
};

/// The points that the keypoints of a capture consist of. For tables with names of their own, these are the points of
/// the first camera's table. @throws FileError as the readers; Error when the capture has no keypoints
PointLayout layout_of_keypoints(const Capture& capture);

/// Follows one person through the rows of a motion: chooses the person, removes the lens distortion, picks the
/// landmarks and filters them. Between two video frames the landmarks are interpolated (fractional_frames.h).
/// @param mask is called for ascending rows, and only when several people were detected and `chosen` is empty
/// @param camera with its distortion, at the resolution of the images in which the points were detected
/// @param chosen the choice by all cameras; empty: the mask chooses
/// @throws Error when the points are not in pixels (all of them are fractions of the image size)
KeypointTrack follow_person(const PeopleOfFrame& people, const MaskOfRow& mask, const LandmarkPicker& picker,
                            const Camera& camera, const FilmedRows& rows, const KeypointFilter& filter,
                            const ChoiceOfFrame& chosen = {});

/// The points of people in the image without distortion.
People undistorted(const Undistorter& undistorter, People people);

/// Keypoints of one person in an image, [M]: chooses the person, removes the lens distortion and picks the landmarks.
/// @param people of the image as filmed, with distortion
/// @param mask of the image without distortion; called only when several people were detected
std::vector<Keypoint> pick_person(std::optional<People> people, const std::function<cv::Mat()>& mask,
                                  const LandmarkPicker& picker, const Undistorter& undistorter);

/// Opens the detector of a capture. @pre the capture has one @param layout of the detected points
PoseDetector open_detector(const Capture& capture, const PointLayout& layout);

/// Warnings about the keypoints of a track, in sentences; empty when there are none.
std::vector<std::string> keypoint_doubts(const KeypointFacts& facts);

}  // namespace doppel
