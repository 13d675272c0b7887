#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// The generalised winding number of any set of triangles: 1 inside and 0 outside of a closed surface, in between near
/// holes. Groups of far triangles count as one dipole (Barill et al. 2018).
class WindingNumber {
 public:
  /// @throws UsageError without faces
  explicit WindingNumber(const TriangleMesh& mesh);

  double at(const Eigen::Vector3d& point) const;

 private:
  struct Node {
    Eigen::Vector3d centre;    // area-weighted
    Eigen::Vector3d area;      // vector area
    double far = 0.0;          // squared distance beyond which the dipole stands for the group
    int first = 0, count = 0;  // leaf: triangles; inner node (count 0): children at first, first + 1
  };
  struct Corners {
    std::array<Eigen::Vector3d, 3> p;
  };
  void summarise(std::size_t node, const std::array<int, 2>& range);

  std::vector<Node> nodes_;
  std::vector<Corners> triangles_;
};

}  // namespace doppel
