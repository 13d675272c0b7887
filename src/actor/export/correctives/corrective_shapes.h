#pragma once

#include "doppel/io/figure_export/figure_clip.h"
#include "doppel/io/figure_export/rest_displacements.h"

namespace doppel {

/// The shapes as targets for weights of 0 to 1: `Corrective_Base` has weight 1, and a weight of 0 and 1 of
/// `Corrective_1`, ... stands for the weights low and high of the components. @param low, high [K] metres
/// @return without weights of frames
MorphTargets corrective_targets(const LinearShapes& shapes, const Eigen::VectorXf& low, const Eigen::VectorXf& high);

}  // namespace doppel
