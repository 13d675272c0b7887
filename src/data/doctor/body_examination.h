#pragma once

#include <optional>
#include <vector>

#include "doppel/data/doctor/rig_examination.h"

namespace doppel {

/// What the triangulated body says about one camera.
struct CameraCoverage {
  double distance = 0.0;  ///< from the camera to the person, median, metres
  double height = 0.0;    ///< of the person in the image, median, pixels
  double inside = 0.0;    ///< share of the body's points that lie within the image
  double detected = 0.0;  ///< share of the instants with a known body in which somebody was detected
  double azimuth = 0.0;   ///< of the camera around the person, degrees, from +z to +x
};

/// What the triangulated body says about the capture.
struct BodyExamination {
  double stature = 0.0;  ///< estimate of the person's height by legs and trunk, metres; 0: not known
  Eigen::Vector3d lowest = Eigen::Vector3d::Zero(), highest = Eigen::Vector3d::Zero();  ///< volume covered, metres
  double largest_gap = 360.0;           ///< between neighbouring cameras around the person, degrees
  std::vector<CameraCoverage> cameras;  ///< [C]
};

/// Examines the size, the upright direction, the sides and the visibility of the body. @param rig with a consensus
BodyExamination examine_body(const Sightings& seen, const RigExamination& rig, std::vector<Finding>& findings);

/// What one camera alone can say: whether the person stands upright in its images.
void examine_single_camera(const Sightings& seen, std::vector<Finding>& findings);

}  // namespace doppel
