#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// The tree of landmarks: the parent of a landmark is the next landmark towards the root of the skeleton.
class LandmarkTree {
 public:
  /// The root of the tree is the landmark nearest to the skeleton's root joint in the rest pose.
  LandmarkTree(const Skeleton& skeleton, const std::vector<Marker>& landmarks, const std::vector<double>& rest_dofs);

  int root() const { return root_; }
  int parent(int landmark) const { return parent_[landmark]; }  ///< -1 for the root

  /// Gives predicted joints the bone lengths of the body (4.5.1): from the root outwards, each bone keeps its direction
  /// and takes the body's length. A landmark without its parent uses the next ancestor; without any, it stays.
  /// @param joints [M] predicted by a network @param body [M] landmarks of the body, in any position and pose
  std::vector<std::optional<Eigen::Vector3d>> with_lengths_of(std::vector<std::optional<Eigen::Vector3d>> joints,
                                                              const std::vector<Eigen::Vector3d>& body) const;

 private:
  int root_ = 0;
  std::vector<int> parent_, order_;  ///< [M]; parents before children
};

}  // namespace doppel
