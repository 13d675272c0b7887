#pragma once

#include <string>
#include <vector>

#include "doppel/geometry/mesh.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {

/// Finds the fingers of the open hands of a scan, and adds their points (`finger_point`). `left_hand` and
/// `left_fingertip` become the knuckle and the tip of the middle finger; likewise right.
///
/// The tips are the maxima of the distance from the wrist along the surface. A maximum stands out by its height above
/// the saddle to a higher one: five do by a tenth of the hand's length, no more and no fewer. The tip nearest to the
/// wrist is the thumb's; the others are ordered across the hand. The line of a finger is the centroids of its sections
/// at equal distance from the wrist, from the tip to the web. Half of the proximal phalanx of a finger, and two fifths
/// of that of the thumb, lie in the hand. So the length of the line scales the phalanges, whose proportions are those
/// of Buryanov and Kotiuk (Proportions of hand segments, 2010).
///
/// A hand with other than five such maxima, because fingers touch, are bent into a fist, or are coarser than the mesh,
/// stays as it is. So does a hand of which points of fingers are known already.
/// @param mesh metres, in the frame of the joints; any number of parts
/// @param joints complete (complete_joints)
/// @return a sentence for each hand that was searched
std::vector<std::string> find_fingers(const TriangleMesh& mesh, BodyJoints& joints);

}  // namespace doppel
