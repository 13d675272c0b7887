#pragma once

/// What `doppel evaluate` measures of a run that captures from one camera (5.8).

#include <nlohmann/json.hpp>

#include "doppel/eval/silhouette_overlap.h"
#include "doppel/actor/trained_pose.h"

namespace doppel {

/// Whether every sequence of a split has a motion: poses to hold captured ones against.
bool poses_are_known(const Dataset& dataset, Split split);

/// The methods `posenet` and, where it was trained, `defnet` on a split: overlaps of the surface, and the distance of
/// landmarks from the keypoints of all cameras. Networks see the images of `options.input_camera` alone, global
/// alignment its keypoints alone. Where poses are known, figures of the pose come along, and surfaces are moved to the
/// true place before they are compared; else they stay where the alignment put them.
nlohmann::ordered_json evaluate_pose_run(const Dataset& dataset, TrainedPose& trained, Split split,
                                         const EvaluationOptions& options);

}  // namespace doppel
