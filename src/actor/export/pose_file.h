#pragma once

#include <filesystem>

#include "doppel/actor/trained_pose.h"

namespace doppel {

/// Writes PoseNet and, if `trained` has one, DefNet, together with kinematics, global alignment and the surface, as one
/// TorchScript file of plain aten operations. `torch::jit::load` and Python's `torch.jit.load` can read the file.
///
/// Methods: `forward(image, rotation) -> (dofs, landmarks, vertices)` with the root's pivot at the origin, and
/// `placed(image, intrinsics, rotation, translation, keypoints) -> (dofs, landmarks, vertices, valid)` in the world.
/// `image` [B,3,S,S] is RGB 0..1, the person on black, in the square window of person_crop.h; `keypoints` [B,M,3] are
/// x, y, confidence. Extra files: `metadata.json`, `faces.npy` and the texture coordinates, as in an actor file.
/// @throws Error when the traced methods differ from `trained` by more than 1e-5 (metres, radians) on a batch of
/// another size
void write_pose_file(const std::filesystem::path& path, TrainedPose& trained);

}  // namespace doppel
