#pragma once

#include <string>
#include <vector>

#include "doppel/data/doctor/body_track.h"

namespace doppel {

/// One explanation of a camera that disagrees with the others, or of a rig whose cameras all disagree.
struct Explanation {
  std::string fault;      ///< one of `faults`
  int parameters = 0;     ///< that were fitted
  SupposedView view;      ///< of the camera
  std::string what;       ///< what was supposed, in words: "the images are mirrored"
  std::string advice;     ///< what to do
  double residual = 0.0;  ///< mean of the windows' medians, share of the person's size
  int other = -1;         ///< camera with which it is swapped
};

/// Mistakes without free numbers: mirrored, turned, inverted, another unit, another resolution, no lens, another
/// camera's position. `residual` is not set.
/// @param swaps also the positions and lenses of the other cameras
std::vector<Explanation> usual_mistakes(const Sightings& seen, int camera, bool swaps);

/// All explanations of one camera, with their residuals: the usual mistakes, and those with fitted numbers: a delay,
/// the focal length, the principal point, the lens, the pose.
std::vector<Explanation> explain_camera(const Sightings& seen, int camera, const BodyTrack& body,
                                        const ChosenInstants& chosen);

/// Explanations by time alone: an offset that grows, and offsets that differ between windows.
std::vector<Explanation> explain_by_time(const Sightings& seen, int camera, const BodyTrack& body,
                                         const ChosenInstants& chosen);

/// "2 rows later" or "2 rows earlier" than it should be.
std::string rows_off(double delay);

/// Which `frame_offset` mends a delay, with the one that is stated, for the sequences of some instants.
/// @param delay rows by which the camera's frames show the body later than they should
std::string advice_of_delay(const Sightings& seen, int camera, double delay, const ChosenInstants& chosen);

/// The explanation with the least residual, where each fitted number must earn its place.
/// @return null when there is none
const Explanation* best_explanation(const std::vector<Explanation>& explanations);

}  // namespace doppel
