#pragma once

#include <torch/torch.h>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/actor/person_input.h"
#include "doppel/actor/run_subject.h"
#include "doppel/character/character.h"
#include "doppel/layers/surface.h"
#include "doppel/nets/def_net.h"
#include "doppel/nets/pose_capture.h"

namespace doppel {

/// What captures a performance from one camera (chapter 5), as far as a run has been trained: PoseNet, then DefNet.
/// Networks are in evaluation mode and need no gradient.
struct TrainedPose {
  RunSubject subject;
  Character character;
  std::vector<Marker> landmarks;                ///< [M] of the capture
  std::vector<std::string> trained_on_cameras;  ///< of PoseNet; empty: all
  std::map<std::string, std::int64_t> steps;    ///< of each stage that is there
  DetectionOptions detections;

  std::optional<PoseDofs> pose;
  Landmarks landmark_layer{nullptr};
  CharacterSurface surface{nullptr};
  PoseNet posenet{nullptr};
  DefNet defnet{nullptr};  ///< null where it was not trained

  /// @param run what `doppel train` wrote: posenet, or a chain of it and defnet
  /// @param capture a prepared folder to use instead of the one the run was trained on
  /// @param with_defnet false: PoseNet alone
  /// @throws Error when the folder is not a run, PoseNet has no checkpoint, or the character is not the one it was
  /// trained for
  static TrainedPose load(const std::filesystem::path& run,
                          const std::optional<std::filesystem::path>& capture = std::nullopt, bool with_defnet = true);

  int input_size() const { return posenet->config().input_size; }
  CapturedPose capture(const PersonView& view);
  /// All DoFs of captured poses. @return [B,D]
  torch::Tensor dofs(const CapturedPose& captured) const;
  /// DefNet's deformation of what the image shows, zeros without DefNet. @return A, T [B,K,3]
  std::pair<torch::Tensor, torch::Tensor> deformation(const torch::Tensor& image);
  /// A digest of PoseNet's weights: what DefNet was trained on.
  std::string digest() const;
};

}  // namespace doppel
