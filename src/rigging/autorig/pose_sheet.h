#pragma once

#include <opencv2/core.hpp>

#include "doppel/character/character.h"

namespace doppel {

/// An image that shows how a rig bends: a row for the rest pose and for each of the five test poses (test_poses), in
/// each the skinned template from four sides: obliquely from the front, and on from there towards the body's left. All
/// rows have the same scale, and the lowest vertex of each pose lies at the same height. The name of the pose stands in
/// the first image of its row.
/// @param height of a row, pixels; the width of a column follows from the extent of the bodies
/// @return 8-bit BGR, 6 rows and 4 columns of images
/// @throws Error as test_poses
cv::Mat draw_pose_sheet(const Character& character, int height = 400);

}  // namespace doppel
