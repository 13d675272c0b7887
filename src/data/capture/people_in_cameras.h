#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/data/capture/evidence.h"
#include "doppel/data/capture/frame_clock.h"
#include "doppel/detect/keypoints/person_choice.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The detected people of a sequence in all its cameras.
struct PeopleInCameras {
  std::string sequence;               ///< its name, for messages
  std::vector<Camera> cameras;        ///< [C] with their lenses, at the resolution of the keypoints
  std::vector<FrameClock> clocks;     ///< [C]
  std::vector<PeopleOfFrame> people;  ///< [C] by video frame, in pixels as filmed
  long first_row = 0, last_row = 0;
};

/// The mask of a camera in a row, without distortion; empty: none.
using MaskOfCamera = std::function<cv::Mat(std::size_t camera, long row)>;

/// Who is followed in each camera, by the agreement of the cameras (follow_people), in the frames nearest to the rows
/// and in those between which points are interpolated. If the options name nobody and several people are found, masks
/// decide: of a few rows, they choose a detection in each camera (index_of_person), and the person with most of these
/// detections is followed. Without masks it is the person with the most support. Doubts are logged as warnings.
/// @param mask may be empty
/// @return [C]
/// @throws UsageError: `person` is no index of a person found; Error as follow_people
std::vector<ChoiceOfFrame> follow_in_cameras(const PeopleInCameras& seen, const PointLayout& layout,
                                             const PersonChoiceOptions& options, const MaskOfCamera& mask);

/// The same where the choice matters: for at least two cameras, of which one found several people in some row, or with
/// options that name a person. Otherwise [C] empty functions, with which follow_person chooses as before.
std::vector<ChoiceOfFrame> follow_if_several(const PeopleInCameras& seen, const PointLayout& layout,
                                             const PersonChoiceOptions& options, const MaskOfCamera& mask);

}  // namespace doppel
