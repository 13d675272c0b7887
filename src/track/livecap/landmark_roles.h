#pragma once

#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// Weights of landmarks, chosen by words in their names (`left_elbow`, `RKnee`). Unknown names have weight 1, and a
/// warning lists them.
struct LandmarkRoles {
  std::vector<double> detection;   ///< [M] lambda_i of (4.3): 0.326 for points of the face, 1 for others
  std::vector<double> steadiness;  ///< [M] lambda_i of (4.6): 2.5 torso and head, 2 shoulders, 1.5 knees and elbows, 1
  std::vector<int> soles;          ///< landmarks of heels and toes, ascending
};
LandmarkRoles landmark_roles(const std::vector<Marker>& landmarks);

}  // namespace doppel
