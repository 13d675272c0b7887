#pragma once

#include <optional>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/detect/keypoints/person_choice.h"
#include "doppel/detect/keypoints/person_guide.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// Everybody whom a detector found in some moments of a sequence.
struct SeenPeople {
  std::vector<Camera> cameras;              ///< [C] with their lenses, of the size of the images
  std::vector<std::vector<People>> people;  ///< [F][C] at the same time in all cameras, pixels as filmed
  PointLayout layout;                       ///< of the people, with `left_hip` and `right_hip`
  long step = 1;                            ///< rows of the motion from one moment to the next
};

/// A person as seen by one camera.
struct PersonAtPixel {
  std::size_t camera = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< near the middle of the hips
};

/// The person to follow, and where each camera sees this person.
struct AnchoredPerson {
  std::vector<FoundPerson> people;  ///< everybody on whom two cameras agree, as PersonChoice
  int person = -1;                  ///< index of the one to follow; -1: no two cameras agree on anybody
  bool ambiguous = false;           ///< as PersonChoice
  bool alone = true;                ///< every detection shows this person
  std::vector<std::vector<std::optional<PersonAnchor>>> anchors;  ///< [C][F]; nothing: not known
  std::vector<std::size_t> doubtful;  ///< cameras that hardly ever agree on the person, and have no anchors
};

/// Finds out who is who (follow_people), and where the chosen person is in each camera. In a moment, the person's hips
/// are at the detection that was chosen for the camera, or, if there is none or its hips are elsewhere, at the
/// projection of the hips that the other cameras see. The radius is 0.35 m at the distance of the person, and half of
/// the distance to the hips of the nearest other person if this is less, but at least 0.15 m. A person without a
/// detection is not visible if the projection is not in the image, or if the detection of another known person is
/// within the radius. Where it is not known at all where the person is, nobody should be followed in a camera that sees
/// another known person. A camera whose detections agree in less than a quarter of the moments in which it should see
/// the person and sees somebody has no anchors: its calibration or its time is not to be trusted.
/// @param wanted instead of what `options` name: the person whose hips are nearest to this pixel in the first moment in
/// which this camera sees somebody
/// @throws UsageError as follow_people; when `wanted` names a camera that never sees anybody whom another camera sees
/// too, or the layout has no hips
AnchoredPerson anchor_person(const SeenPeople& seen, const PersonChoiceOptions& options,
                             const std::optional<PersonAtPixel>& wanted = std::nullopt);

}  // namespace doppel
