#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/character/character.h"

namespace doppel {

/// The metadata of an exported actor.
struct ActorDescription {
  std::string name;
  int past_frames = 2;                   ///< F: the actor takes F + 1 frames of motion, oldest first
  std::vector<std::string> dof_names;    ///< [D] the columns of its input
  std::vector<std::string> joint_names;  ///< [J]
  int num_vertices = 0;
  double frames_per_second = 25.0;  ///< of the training motion: the motion window contains velocities
  std::string fingerprint;          ///< of the character (Character::fingerprint)
  int texture_size = 0;             ///< T: texels along a side of the dynamic texture; 0: no dynamic texture
  int num_gaussians = 0;            ///< P; 0: no Gaussians
};

/// The content of `metadata.json`: names, window, DoF and joint names, units, frame rate, fingerprint.
nlohmann::ordered_json actor_metadata(const Character& character, const ActorDescription& description);

}  // namespace doppel
