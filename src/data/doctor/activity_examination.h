#pragma once

#include <vector>

#include "doppel/data/doctor/finding.h"
#include "doppel/data/doctor/image_facts.h"

namespace doppel {

/// Compares what moves in the videos of a sequence with what moves by the keypoints: finds videos that are exchanged,
/// mirrored or turned although their keypoints are not, and keypoints of other footage. Where the person stands still
/// by the keypoints, or hardly anything moves in a video, nothing is known.
/// @return false: the keypoints are not of this footage, so nothing else should be compared with them
bool examine_activity(const Sightings& seen, const RigExamination* rig, const SequenceFootage& footage,
                      std::vector<Finding>& findings);

/// Decides for cameras that have the keypoints of each other (RigExamination::exchanged) whether their footage is
/// exchanged, or their keypoint files alone: then the body that the cameras agree on lies on their own masks, or,
/// without masks, what moves in their videos is where the keypoints of the other camera are. Of keypoint files alone,
/// the findings say so, and nothing is compared with the keypoints of these cameras any more.
/// @param footage [sequences]
void settle_exchanges(const Sightings& seen, RigExamination& rig, std::vector<SequenceFootage>& footage,
                      std::vector<Finding>& findings);

/// How well the limbs of `shift` rows later agree with what moves in the videos of a sequence: the mean contrast of the
/// cameras; NaN where nothing is known.
double contrast_of_shift(const Sightings& seen, const RigExamination* rig, const SequenceFootage& footage, int shift);

}  // namespace doppel
