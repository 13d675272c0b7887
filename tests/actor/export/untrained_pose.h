#pragma once

#include "doppel/actor/trained_pose.h"
#include "support/test_character.h"

namespace doppel::support {

inline constexpr int kPoseInput = 70;

/// Networks that nobody trained, with outputs large enough to see.
inline TrainedPose untrained_pose(bool with_defnet) {
  TrainedPose trained;
  trained.character = make_test_character();
  trained.landmarks = trained.character.skeleton.markers;
  trained.pose.emplace(trained.character.skeleton, std::vector<std::string>{}, trained.character.rest_dofs);
  trained.landmark_layer = Landmarks(trained.character.skeleton, trained.landmarks);
  trained.surface = CharacterSurface(trained.character);
  PoseNetConfig config;
  config.kind = ResNetKind::resnet18;
  config.input_size = kPoseInput;
  config.head_scale = 0.02;
  trained.posenet = PoseNet(*trained.pose, config);
  trained.posenet->eval();
  if (!with_defnet) return trained;
  config.head_scale = 0.002;
  trained.defnet = DefNet(trained.character.num_nodes(), config, at::detail::createCPUGenerator(4));
  trained.defnet->eval();
  return trained;
}

}  // namespace doppel::support
