#pragma once

/// What `doppel evaluate` measures of a run that captures from one camera (5.8).

#include <nlohmann/json.hpp>

#include "doppel/eval/silhouette_overlap.h"
#include "doppel/train/trained_pose.h"

namespace doppel::tools {

/// The methods `posenet` and, where it was trained, `defnet` on a split: pose figures against the capture's own motion,
/// and overlaps of the surface, which is moved to the true place first. Networks see the pictures of
/// `options.input_camera` alone, global alignment its keypoints alone.
nlohmann::ordered_json evaluate_pose_run(const Dataset& dataset, TrainedPose& trained, Split split,
                                         const EvaluationOptions& options);

}  // namespace doppel::tools
