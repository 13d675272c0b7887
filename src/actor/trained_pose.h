#pragma once

#include <torch/types.h>

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

/// The networks of a run that capture a performance from one camera (chapter 5), with all networks trained so far:
/// PoseNet, then DefNet. Networks are in evaluation mode and need no gradient.
struct TrainedPose {
  RunSubject subject;
  Character character;
  std::vector<Marker> landmarks;                ///< [M] of the capture
  std::vector<std::string> trained_on_cameras;  ///< of PoseNet; empty: all
  std::map<std::string, std::int64_t> steps;    ///< of each loaded stage
  DetectionOptions detections;

  std::optional<PoseDofs> pose;
  Landmarks landmark_layer{nullptr};
  CharacterSurface surface{nullptr};
  PoseNet posenet{nullptr};
  DefNet defnet{nullptr};  ///< null if it was not trained

  /// @param run output of `doppel train`: posenet, or a chain of posenet and defnet
  /// @param capture a prepared capture to use instead of the one the run was trained on
  /// @param with_defnet false: PoseNet alone
  /// @throws Error when the folder is not a run, PoseNet has no checkpoint, or the character is not the one it was
  /// trained for
  static TrainedPose load(const std::filesystem::path& run,
                          const std::optional<std::filesystem::path>& capture = std::nullopt, bool with_defnet = true);

  int input_size() const { return posenet->config().input_size; }
  CapturedPose capture(const PersonView& view);
  /// All DoFs of captured poses. @return [B,D]
  torch::Tensor dofs(const CapturedPose& captured) const;
  /// DefNet's deformation for an image; zeros without DefNet. @return A, T [B,K,3]
  std::pair<torch::Tensor, torch::Tensor> deformation(const torch::Tensor& image);
  /// A digest of PoseNet's weights. It identifies what DefNet was trained on.
  std::string digest() const;
};

}  // namespace doppel
