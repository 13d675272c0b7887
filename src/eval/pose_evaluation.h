#pragma once

/// The measurements of `doppel evaluate` for a run that captures from one camera (5.8).

#include <nlohmann/json.hpp>

#include "doppel/actor/trained_pose.h"
#include "doppel/eval/silhouette_overlap.h"

namespace doppel {

/// Whether every sequence of a split has a motion, which captured poses can be compared with.
bool poses_are_known(const Dataset& dataset, Split split);

/// Evaluates the methods `posenet` and, if it was trained, `defnet` on a split: overlaps of the surface, and the
/// distance of landmarks from the keypoints of all cameras. The networks use only the images of `options.input_camera`;
/// global alignment uses only the keypoints of this camera. Where poses are known, pose metrics are added, and surfaces
/// are moved to the true position before they are compared. Otherwise surfaces are compared at the position from global
/// alignment.
nlohmann::ordered_json evaluate_pose_run(const Dataset& dataset, TrainedPose& trained, Split split,
                                         const EvaluationOptions& options);

}  // namespace doppel
