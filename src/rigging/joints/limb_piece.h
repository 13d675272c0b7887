#pragma once

#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// The positions of a limb's joints, metres: the upper bone runs from `top` to `joint`, the lower one from there to
/// `end`.
struct LimbPositions {
  Eigen::Vector3d top, joint, end;
};

/// The piece of a limb around its middle joint, of which the volume is measured in several poses. It consists of the
/// triangles of the limb between two planes: across the middle of the upper bone and across the middle of the lower
/// bone. Each hole of the piece (where it is cut, a cuff, a hole of the scan) is closed by a fan of triangles to the
/// mean of the hole's vertices. Layers of clothes count like skin. A surface with a hole along more than half of the
/// piece is no limb (a half of a skirt, an arm that has grown together with the trunk), and the piece is empty.
class LimbPiece {
 public:
  /// @param vertices [N] in the rest pose @param of_limb [N] whether a vertex belongs to the limb
  LimbPiece(const std::vector<Eigen::Vector3d>& vertices, const std::vector<Triangle>& faces,
            const std::vector<bool>& of_limb, const LimbPositions& positions);

  bool empty() const { return faces_.empty(); }
  const std::vector<Triangle>& faces() const { return faces_; }
  /// The vertices of these faces, ascending.
  const std::vector<int>& vertices() const { return vertices_; }
  /// The signed volume in a pose, cubic metres; parts of the surface that overlap count twice. 0 if empty.
  /// @param vertices [N]
  double volume(const std::vector<Eigen::Vector3d>& vertices) const;

 private:
  struct Cap {
    std::vector<int> vertices;
    std::vector<std::array<int, 2>> edges;  ///< counter-clockwise around the cap's outside
  };
  std::vector<Triangle> faces_;
  std::vector<int> vertices_;
  std::vector<Cap> caps_;
};

}  // namespace doppel
