#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/capture/capture.h"
#include "doppel/capture/keypoint_map.h"
#include "doppel/capture/mask.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// What a capture's keypoints are put on.
struct EvidencePlan {
  KeypointMap map;
  std::string map_name;           ///< of the map: built in, "names", or a path as written
  std::vector<Marker> landmarks;  ///< [M]; none: the capture has no keypoints, or nothing to put them on
};

/// Chooses map and landmarks: those of the placement file, else the skeleton's markers that the map knows. Without
/// `keypoint_map`, tables (.csv) name landmarks, other files and a detector's points are taken for BODY_25. Keypoints
/// without any landmark are left alone with a warning, unless the capture asks for a map.
/// @throws Error for a detector whose points have no order (the map `names`), for landmarks that the map does not know,
/// or what its readers throw
EvidencePlan plan_evidence(const Capture& capture, const Character& character);

/// What was found of the keypoints of one camera in one sequence.
struct KeypointFacts {
  long frames = 0;
  long missing_files = 0;  ///< frames without a file
  long nobody = 0;         ///< frames in which nobody was found, missing files included
  long several = 0;        ///< frames in which more than one person was found
  long unsure = 0;         ///< frames with people, but no landmark of at least kSeenConfidence
  double seen = 0.0;       ///< share of landmarks, over all frames, of at least kSeenConfidence
};

/// The keypoints of one camera in consecutive frames, on landmarks, in pixels of the image without distortion.
struct KeypointTrack {
  std::vector<std::vector<Keypoint>> frames;  ///< [F] of [M]
  KeypointFacts facts;
};

/// Where the people of a video frame come from, and the mask of the frame (empty: none); both by video frame.
using PeopleOfFrame = std::function<std::optional<People>(long frame)>;
using MaskOfFrame = std::function<cv::Mat(long frame)>;

/// Follows one person through the frames `first` to `last` of a video: chooses whom, takes the lens distortion out,
/// picks the landmarks and filters them.
/// @param camera with its distortion, at the resolution of the images that points were found in
/// @param cuts video frames that begin a new segment
/// @throws Error when the points are no pixels (all of them parts of the image's size)
KeypointTrack follow_person(const PeopleOfFrame& people, const MaskOfFrame& mask, const LandmarkPicker& picker,
                            const Camera& camera, long first, long last, const std::vector<long>& cuts,
                            const KeypointFilter& filter);

/// The one person of an image: chooses whom, takes the lens distortion out and picks the landmarks. [M]
/// @param people of the image as it was filmed @param mask of the image without distortion; asked for where
/// several people were found
std::vector<Keypoint> pick_person(std::optional<People> people, const std::function<cv::Mat()>& mask,
                                  const LandmarkPicker& picker, const Undistorter& undistorter);

/// The capture's detector, which it must have. @param layout of the points that it finds
PoseDetector open_detector(const Capture& capture, const PointLayout& layout);

/// What should be said about a track, in plain sentences; empty when all is well.
std::vector<std::string> keypoint_doubts(const KeypointFacts& facts);

}  // namespace doppel
