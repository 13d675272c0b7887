#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/geometry/camera.h"

namespace doppel {

struct PersonChoiceOptions {
  std::optional<int> person;            ///< index into PersonChoice::people; nothing: the one with the most support
  std::optional<Eigen::Vector3d> near;  ///< world, metres: the person whose mean position is nearest; not with `person`
  double max_residual = 0.02;           ///< of a point that agrees, as a share of the image's height
  int longest_gap = 15;                 ///< frames over which a person that was lost is expected to go on
  long step = 1;                        ///< frames of the film from one of the given frames to the next

  /// Whether the options say who is followed.
  bool names_person() const { return person || near; }
};

/// A person whose points agree between cameras.
struct FoundPerson {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< mean of the body's middle, world metres
  double frames = 0.0;    ///< share of the frames in which at least two cameras agree on the person
  double views = 0.0;     ///< cameras that agree, mean over these frames
  double residual = 0.0;  ///< mean distance of agreeing points from the projections, as a share of the image's height
  double support = 0.0;   ///< sum over frames and pairs of cameras of the share of points that agree
};

struct PersonChoice {
  std::vector<std::vector<int>> chosen;  ///< [F][C] index into the camera's people; -1: none is this person
  std::vector<FoundPerson> people;  ///< everybody found, most support first; those with little support are left out
  int person = -1;                  ///< index of the chosen one; -1: nobody was found
  std::vector<double> cameras;      ///< [C] share of the frames in which a person of this camera was chosen
  bool ambiguous = false;           ///< another person agrees about as well, and the options name none

  /// What a user should know, in sentences: nobody found, several people, cameras that never agree.
  std::vector<std::string> doubts(const std::vector<Camera>& cameras_of_choice) const;
};

/// Follows one person in several calibrated cameras: chooses in each frame and camera the detection that shows this
/// person. In each frame, every pair of detections of two cameras proposes a body by triangulating its points. The
/// detections of all cameras whose points are near the projections of the body agree with it; its points are
/// triangulated again from the views that agree (triangulation.h); then points at twice the distance suffice. Of bodies
/// that share detections, the one that more cameras agree on wins. Bodies are then linked over time by their positions;
/// a body is expected to go on in a line for up to 15 frames, so people who cross keep apart.
/// The person with the most support is chosen, so people who pass in the background of a few cameras lose. In frames in
/// which fewer than two cameras see the person, the body moves on in a line. A detection whose left and right are
/// swapped agrees as well; the mirrored order follows from the names of the points (landmark_key).
/// @param frames [F] of [C], `step` frames apart, synchronous; points in pixels as filmed, with distortion
/// @param cameras [C] with their lenses and the size of their images
/// @param layout of the points; every person has as many
/// @throws UsageError: `person` is not the index of a person found, or both options are given; Error: other numbers of
/// cameras or points, a camera without size
PersonChoice follow_people(const std::vector<std::vector<People>>& frames, const std::vector<Camera>& cameras,
                           const PointLayout& layout, const PersonChoiceOptions& options = {});

}  // namespace doppel
