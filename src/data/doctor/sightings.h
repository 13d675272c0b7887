#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/frame_clock.h"
#include "doppel/data/doctor/finding.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A point of a detected person.
struct SeenPoint {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< as filmed, with distortion
  bool seen = false;
};
/// A detected person: [K] points in the order of Sightings::points.
using SeenPerson = std::vector<SeenPoint>;

/// A row of a sequence.
struct Instant {
  int sequence = 0;
  int segment = 0;  ///< consecutive rows of one segment may be interpolated; counted over all sequences
  long row = 0;
};

/// What capture.yaml states about the times of a camera's files in a sequence.
struct StatedTimes {
  FrameClock clock;
  long keypoint_offset = 0, mask_offset = 0;  ///< number of video frame 0 in the files
};

/// Everybody whom the detector found, in all cameras, sequences and rows that are examined.
struct Sightings {
  std::vector<Camera> cameras;                  ///< [C] at the resolution of their images, with distortion
  std::vector<Camera> calibrated;               ///< [C] as the calibration states them
  std::vector<int> file_index;                  ///< [C] position in the calibration
  double scale = 1.0;                           ///< units of the cameras' world per metre, see normalise_scale
  std::string up;                               ///< axis of the calibration file's world that points up: "+z"
  std::vector<std::string> sequences;           ///< names
  std::vector<std::vector<StatedTimes>> times;  ///< [sequences][C]
  std::vector<std::string> points;              ///< [K] names (landmark_key)
  std::vector<int> mirrored;                    ///< [K] the same part on the other side of the body
  std::vector<Instant> instants;                ///< [N]
  std::vector<std::vector<std::vector<SeenPerson>>> people;  ///< [C][N] of people
  std::vector<double> size;                                  ///< [C] median diagonal of a person's points, pixels
  std::vector<std::array<int, 2>> bones;                     ///< points that are neighbours on the body
  std::vector<std::vector<int>> windows;                     ///< instants that follow each other, in pieces

  int num_cameras() const { return static_cast<int>(cameras.size()); }
  int num_instants() const { return static_cast<int>(instants.size()); }
  int num_points() const { return static_cast<int>(points.size()); }
  /// The index of a point by its landmark_key; -1: none.
  int point(const std::string& key) const;
  bool has_people() const;
};

/// Reads cameras, rows and detections of all sequences. What cannot be read becomes a finding, and the rest goes on.
/// @param most_rows over all sequences; of longer captures, pieces of consecutive rows are read
/// @param footage whether videos must be there; otherwise sizes and lengths of missing ones come from calibration and
///   keypoints; where the calibration has no sizes, the principal point is taken for the middle of the image
/// @throws FileError for a calibration that cannot be read; Error for a capture without sequences
Sightings read_sightings(const Capture& capture, long most_rows, std::vector<Finding>& findings, bool footage = true);

/// Brings the cameras to a usual distance from each other, so that a calibration in a wrong unit can be examined like
/// any other. Multiplies all translations by `scale`.
void normalise_scale(Sightings& sightings);

/// The windows, the bones and the sizes of the people. @param sightings with all other members
void complete_sightings(Sightings& sightings);

}  // namespace doppel
