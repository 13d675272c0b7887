#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// Which landmark each landmark hangs on: the next one towards the root of the skeleton.
class LandmarkTree {
 public:
  /// The landmark that lies nearest to the skeleton's root joint in the rest pose is the tree's root.
  LandmarkTree(const Skeleton& skeleton, const std::vector<Marker>& landmarks, const std::vector<double>& rest_dofs);

  int root() const { return root_; }
  int parent(int landmark) const { return parent_[static_cast<std::size_t>(landmark)]; }  ///< -1 for the root

  /// Joints as a network places them, made as far apart as the body's own (4.5.1): from the root outwards each bone
  /// keeps its direction and takes the body's length. A landmark whose parent is missing hangs on the next one above;
  /// if none is there, it stays.
  /// @param joints [M] @param body [M] where the body has its landmarks, in any place and pose
  std::vector<std::optional<Eigen::Vector3d>> with_lengths_of(std::vector<std::optional<Eigen::Vector3d>> joints,
                                                              const std::vector<Eigen::Vector3d>& body) const;

 private:
  int root_ = 0;
  std::vector<int> parent_, order_;  ///< [M]; parents before children
};

}  // namespace doppel
