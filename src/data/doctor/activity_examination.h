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

}  // namespace doppel
