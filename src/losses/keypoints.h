#pragma once

/// Keypoint losses: compare projected landmarks with their keypoints.
///
///   L = mean over cameras and batch of  sum over m of lambda_m sigma_cm |s_c (pi_c(p_m) - k_cm)|^2
///
/// Equations: 5.6, with the landmarks of the skeleton, and 5.12, with those of the deformed graph and lambda = 1. The
/// scale s_c = 1024 / image width makes weights independent of the resolution.
/// Letters: B batch, C cameras, M landmarks.

#include <torch/types.h>

#include <string>
#include <vector>

namespace doppel {

/// The keypoints with which landmarks are compared.
struct KeypointTarget {
  torch::Tensor keypoints;   ///< [B,C,M,3] x, y in pixels of the undistorted image, confidence sigma
  torch::Tensor projection;  ///< [B,C,3,4] K [R|t]: pixels of the undistorted image from world metres
  torch::Tensor scale;       ///< [B,C] 1024 / image width
};

struct KeypointLossOptions {
  double confidence_threshold = 0.4;  ///< keypoints below it do not count (5.2)
  double nearest_depth = 0.1;         ///< metres; landmarks with a smaller depth do not count in a camera
};

/// The mean is over the cameras in which at least one keypoint counts; 0 without such a camera.
/// @param points [B,M,3] world, metres
/// @param lambda [M] weights of the landmarks; undefined: 1
/// @return scalar >= 0, in the type of `points`
/// Gradient: to `points`; keypoints and landmarks that are not finite have none.
/// @throws UsageError naming the argument, with the shape found
torch::Tensor keypoint_loss(const torch::Tensor& points, const KeypointTarget& target, const torch::Tensor& lambda = {},
                            const KeypointLossOptions& options = {});

/// The number of cameras that the mean is over.
std::int64_t keypoint_cameras(const torch::Tensor& points, const KeypointTarget& target,
                              const KeypointLossOptions& options = {});

/// Mean distance over the batch between projections and the keypoints that count, in scaled pixels, for reports; 0
/// without such keypoints. A landmark behind the camera, or not finite, is as far off as the image is wide (1024).
/// Otherwise a pose behind the camera would have the smallest error. @return scalar without gradient
torch::Tensor keypoint_error(const torch::Tensor& points, const KeypointTarget& target,
                             const KeypointLossOptions& options = {});

/// The kinds of landmarks in the schedule: torso (neck, shoulders, hips), elbows and knees, others.
enum class LandmarkKind { torso, elbow_or_knee, other };
/// The kind by name, for any side and spelling: "left_shoulder", "RShoulder", "mid_hip".
LandmarkKind landmark_kind(const std::string& name);

/// lambda_m of 5.6. First third of a stage: 3 for the torso, 2 for elbows and knees, 1 for others. After it: 3 for all.
/// @param progress of the stage, 0 to 1 @return float32 [M]
torch::Tensor landmark_weights(const std::vector<std::string>& names, double progress);

}  // namespace doppel
