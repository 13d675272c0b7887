#pragma once

/// Errors of a captured pose against the true pose (5.8.3): 14 joints, bones rescaled to the true lengths.

#include <torch/types.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace doppel {

/// The rows in a list of landmarks of the 14 joints that most datasets share: head, neck, right shoulder, elbow, wrist,
/// left shoulder, elbow, wrist, right hip, knee, ankle, left hip, knee, ankle. Names may be spelled in different ways:
/// "left_shoulder", "LShoulder". The nose may stand for the head.
/// @throws UsageError listing the missing joints
std::vector<std::int64_t> common_joint_rows(const std::vector<std::string>& landmark_names);
/// Whether a list of landmarks has all of these joints.
bool has_common_joints(const std::vector<std::string>& landmark_names);

/// The root of poses: the midpoint of the hips. @param joints [frames,14,3] @return [frames,1,3]
torch::Tensor root_of_joints(const torch::Tensor& joints);

struct PoseScores {
  std::int64_t frames = 0;   ///< compared
  std::int64_t missing = 0;  ///< frames without a pose (not finite); all their joints count as wrong in PCK and AUC
  double GLE_mm = 0.0;       ///< distance between the roots, mean over frames with a pose
  double PCK = 0.0;          ///< % of joints within 150 mm of the true joints, roots aligned
  double AUC = 0.0;          ///< %, mean of PCK over thresholds 0, 5, ..., 150 mm
  double MPJPE_mm = 0.0;     ///< mean distance of joints after similarity alignment of each frame

  nlohmann::ordered_json to_json() const;
};

/// @param found, ground_truth [frames,14,3] in the order of common_joint_rows, world metres, any float type
/// @throws UsageError for another shape, no frames, or ground truth that is not finite
PoseScores compare_poses(const torch::Tensor& found, const torch::Tensor& ground_truth);

/// Poses with the bone directions of `found` and the bone lengths of `ground_truth`, starting at the root. A bone of
/// length 0 keeps its length.
/// @param found, ground_truth [frames,14,3] @return float64 [frames,14,3]
torch::Tensor rescale_bones(const torch::Tensor& found, const torch::Tensor& ground_truth);

/// Aligns `found` to `ground_truth` by the similarity transform of each frame (rotation, translation, one scale) with
/// the least squared error. @param found, ground_truth [frames,J,3] finite @return float64 [frames,J,3]
torch::Tensor align_similarity(const torch::Tensor& found, const torch::Tensor& ground_truth);

}  // namespace doppel
