#pragma once

#include <torch/script.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/actor/export/script_file.h"
#include "doppel/actor/trained_pose.h"

namespace doppel {

/// The metadata of a pose file. Letters: B batch, S side of the images, D DoFs, M landmarks, N vertices.
struct PoseFileDescription {
  std::string name;                         ///< of the character
  int input_size = 0;                       ///< S
  bool deformed = false;                    ///< DefNet deforms the surface; false: the surface is skinned
  double confidence_threshold = 0.4;        ///< keypoints with lower confidence do not count
  std::vector<std::string> dof_names;       ///< [D] columns of the poses, as in a motion file
  std::vector<std::string> joint_names;     ///< [J]
  std::vector<std::string> landmark_names;  ///< [M] rows of keypoints and landmarks
  int num_vertices = 0;
  std::string fingerprint;  ///< of the character (Character::fingerprint)
};

/// PoseNet and DefNet as methods of a script module; pose_file.h describes the methods `forward` and `placed`.
struct TracedPose {
  ScriptFileWriter file;
  PoseFileDescription description;
  nlohmann::ordered_json metadata;  ///< of the file
};
/// @throws Error when the traced methods differ from `trained` by more than 1e-5 (metres, radians) on a batch of
/// another size
TracedPose traced_pose(TrainedPose& trained);

/// Inputs of `placed`: images of noise, cameras three metres away, and keypoints about the origin.
/// @return image, intrinsics, rotation, translation, keypoints
torch::jit::Stack sample_of_placed(const PoseFileDescription& description, int batch);

}  // namespace doppel
