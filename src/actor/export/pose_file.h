#pragma once

#include <torch/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/actor/export/pose_trace.h"
#include "doppel/actor/export/script_file.h"
#include "doppel/actor/trained_pose.h"

namespace doppel {

/// The camera of each sample. Pixels are those of the whole image without lens distortion, as for the keypoints; the
/// centre of the first pixel is (0.5, 0.5).
struct CameraTensors {
  torch::Tensor intrinsics;   ///< [B,3,3]
  torch::Tensor rotation;     ///< [B,3,3] camera from world
  torch::Tensor translation;  ///< [B,3] camera from world, metres
};

/// The output of a pose file for each sample.
struct CapturedPerson {
  torch::Tensor dofs;       ///< [B,D] in the units of a motion file
  torch::Tensor landmarks;  ///< [B,M,3] world metres
  torch::Tensor vertices;   ///< [B,N,3] world metres
  torch::Tensor valid;      ///< bool [B]: the keypoints determine the position; undefined without keypoints
};

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

/// A pose file that was read.
class PoseFile {
 public:
  /// @throws FileError when the file is not a pose file; the message says what is missing, or what the file is
  static PoseFile load(const std::filesystem::path& path);

  const PoseFileDescription& description() const { return description_; }
  /// The pose with the root's pivot at the origin. @param image [B,3,S,S] @param rotation [B,3,3] camera from world
  /// @throws Error for another shape
  CapturedPerson forward(const torch::Tensor& image, const torch::Tensor& rotation) const;
  /// The pose in the world, from keypoints [B,M,3] of the same camera. @throws Error for another shape
  CapturedPerson placed(const torch::Tensor& image, const CameraTensors& camera, const torch::Tensor& keypoints) const;

 private:
  void check(const char* what, const torch::Tensor& tensor, at::IntArrayRef shape) const;
  mutable ScriptFile file_;
  PoseFileDescription description_;
};

}  // namespace doppel
