#pragma once

#include <vector>

#include "doppel/data/doctor/finding.h"
#include "doppel/data/doctor/image_facts.h"

namespace doppel {

/// Compares the images of each camera with those of the other cameras: exposure, white balance, sharpness, lost and
/// doubled frames, and whether the person moves where the keypoints are.
/// @param footage [sequences]
/// @return false: the keypoints of a sequence are not of its footage, so nothing should be compared with keypoints
bool examine_images(const Sightings& seen, const RigExamination* rig, const std::vector<SequenceFootage>& footage,
                    std::vector<Finding>& findings);

/// Compares masks with keypoints, with the projected body, with their neighbours in time and with the other cameras'.
/// If most cameras fail because keypoints and masks are of different times, this is one finding for all cameras.
void examine_masks(const Sightings& seen, const RigExamination* rig, const std::vector<SequenceFootage>& footage,
                   std::vector<Finding>& findings);

}  // namespace doppel
